#include "core/cpu/treelet.h"

#include <algorithm>
#include <limits>
#include <random>

#include "core/cpu/cpu_builder.h"
#include "core/cpu/lbvh.h"
#include "gtest/gtest.h"
#include "tests/clouds.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

constexpr std::uint32_t kLeafSize = 8;

Box BoxOf(const Photons& photons) {
  Box box;
  for (std::size_t i = 0; i < photons.size(); ++i) box.Extend(photons.position(i));
  return box;
}

TreeletCost MakeCost(const Photons& photons, Heuristic heuristic, LeafTerm leaf_term) {
  const Box box = BoxOf(photons);
  const float longest =
      std::max({box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  return {Measure(heuristic, box, 0.02f * longest), leaf_term, kLeafSize};
}

LooseTree Lbvh(const Photons& photons, std::uint32_t leaf_size) {
  return BuildLbvh(photons.positions, MortonBits::k30, MortonLayout::kCubic, leaf_size);
}

/// The whole cost of a tree, in double: what restructuring lowers.
double CostOf(const TreeletCost& cost, const LooseTree& tree, const Subtree& subtree) {
  const double leaf = double{cost.measure(subtree.box)} * (1 + 0.2 * subtree.count);
  if (subtree.is_leaf()) return leaf;
  const auto& [left, right] = tree.nodes[subtree.link];
  const double inner =
      cost.measure(subtree.box) + CostOf(cost, tree, left) + CostOf(cost, tree, right);
  return cost.MayMerge(subtree.count) ? std::min(leaf, inner) : inner;
}

std::vector<std::uint32_t> SortedIds(const Tree& tree) {
  std::vector<std::uint32_t> ids;
  for (const LeafPhoton& photon : tree.photons) ids.push_back(photon.id);
  std::sort(ids.begin(), ids.end());
  return ids;
}

struct Case {
  std::string name;
  TreeletOptions options;
  LeafTerm leaf_term;
};

class EveryMethod : public testing::TestWithParam<Case> {};

TEST_P(EveryMethod, CostsNeverRiseAndPhotonsStay) {
  const auto& [name, options, leaf_term] = GetParam();
  const TreeKind kind =
      options.method == TreeletMethod::kKdTree ? TreeKind::kKdTree : TreeKind::kBvh;
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 2, 3, 6, 7, 8, 50, 3001}) {
      const Photons photons = MakeCloud(shape, size, /*seed=*/7);
      for (const Heuristic heuristic : {Heuristic::kSah, Heuristic::kIsa, Heuristic::kVvh}) {
        const TreeletCost cost = MakeCost(photons, heuristic, leaf_term);
        LooseTree tree = Lbvh(photons, leaf_term == LeafTerm::kNone ? kLeafSize : 2);
        double before = CostOf(cost, tree, tree.root);
        for (std::uint32_t round = 0; round < 3; ++round) {
          RestructureTreelets(tree, cost, options);
          const double after = CostOf(cost, tree, tree.root);
          ASSERT_LE(after, before * (1 + 1e-5)) << shape.name << " " << size;
          before = after;
        }
        const Tree arranged = Arrange(tree, kind, kLeafSize);
        const absl::Status status = ValidateTree(arranged, photons);
        ASSERT_TRUE(status.ok()) << shape.name << " " << size << " " << status;
        const auto ids = SortedIds(arranged);
        for (std::uint32_t i = 0; i < size; ++i) ASSERT_EQ(ids[i], i);
      }
    }
  }
}

TEST_P(EveryMethod, SavesWhereThereIsSomethingToSave) {
  const auto& [name, options, leaf_term] = GetParam();
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 5003, /*seed=*/7);
  const TreeletCost cost = MakeCost(photons, Heuristic::kIsa, leaf_term);
  LooseTree tree = Lbvh(photons, leaf_term == LeafTerm::kNone ? kLeafSize : 2);
  const double before = CostOf(cost, tree, tree.root);
  RestructureTreelets(tree, cost, options);
  EXPECT_LT(CostOf(cost, tree, tree.root), 0.98 * before);
}

INSTANTIATE_TEST_SUITE_P(
    Methods, EveryMethod,
    testing::Values(
        Case{"kd_7", {TreeletMethod::kKdTree, 7, 1}, LeafTerm::kNone},
        Case{"kd_7_leaf_term", {TreeletMethod::kKdTree, 7, 1}, LeafTerm::kLeafSize},
        Case{"kd_5", {TreeletMethod::kKdTree, 5, 1}, LeafTerm::kLeafSize},
        Case{"kd_9", {TreeletMethod::kKdTree, 9, 1}, LeafTerm::kLeafSize},
        Case{"kd_12", {TreeletMethod::kKdTree, 12, 1}, LeafTerm::kLeafSize},
        Case{"bvh_7", {TreeletMethod::kBvh, 7, 1}, LeafTerm::kNone},
        Case{"bvh_7_leaf_term", {TreeletMethod::kBvh, 7, 1}, LeafTerm::kLeafSize},
        Case{"agglomerative_9", {TreeletMethod::kAgglomerative, 9, 1}, LeafTerm::kNone},
        Case{"agglomerative_32", {TreeletMethod::kAgglomerative, 32, 1}, LeafTerm::kLeafSize}),
    [](const auto& test) { return test.param.name; });

/// The least cost of a whole k-d tree over the leaves of `tree`, by trying all partitions.
float ExhaustiveCost(const TreeletCost& cost, const std::vector<Subtree>& leaves) {
  if (leaves.size() == 1) {
    return cost.MayMerge(leaves[0].count) ? cost.Leaf(leaves[0].box, leaves[0].count) : 0.0f;
  }
  const auto unite = [](const std::vector<Subtree>& parts) {
    Subtree all = parts.front();
    for (std::size_t i = 1; i < parts.size(); ++i) all = Join(0, all, parts[i]);
    return all;
  };
  float best = std::numeric_limits<float>::infinity();
  for (std::uint32_t mask = 1; mask + 1 < 1u << leaves.size(); mask += 2) {
    std::vector<Subtree> a, b;
    for (std::size_t i = 0; i < leaves.size(); ++i) (mask >> i & 1 ? a : b).push_back(leaves[i]);
    if (!Separable(unite(a).box, unite(b).box)) continue;
    best = std::min(best, ExhaustiveCost(cost, a) + ExhaustiveCost(cost, b));
  }
  const Subtree all = unite(leaves);
  return cost.Node(all.box, all.count, best).cost;
}

// Seven photons are one treelet: nothing is cheaper than what comes out.
TEST(TreeletTest, ATreeOfOneTreeletIsTheCheapest) {
  const unsigned fresh = std::random_device{}();
  SCOPED_TRACE(fresh);
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u, 9u, fresh}) {
    const Photons photons = MakeCloud(CloudNamed("uniform"), 7, seed);
    for (const LeafTerm leaf_term : {LeafTerm::kNone, LeafTerm::kLeafSize}) {
      TreeletCost cost = MakeCost(photons, Heuristic::kIsa, leaf_term);
      cost.max_leaf_size = 3;
      LooseTree tree = Lbvh(photons, 1);
      std::vector<Subtree> leaves;
      for (std::uint32_t i = 0; i < 7; ++i) leaves.push_back(MakeLeaf(tree.photons, i, i + 1));
      RestructureTreelets(tree, cost, {.treelet_size = 7, .rounds = 1});
      double kept = 0;  // of leaves that cost nothing without the leaf term
      if (leaf_term == LeafTerm::kNone) {
        for (const Subtree& leaf : leaves) kept += cost.Leaf(leaf.box, 1);
      }
      EXPECT_NEAR(CostOf(cost, tree, tree.root), ExhaustiveCost(cost, leaves) + kept, 1e-5);
    }
  }
}

TEST(TreeletTest, MoreRoundsAndLargerTreeletsSaveMore) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 20011, /*seed=*/7);
  const TreeletCost cost = MakeCost(photons, Heuristic::kIsa, LeafTerm::kLeafSize);
  const auto cost_after = [&](std::uint32_t size, std::uint32_t rounds) {
    LooseTree tree = Lbvh(photons, 2);
    RestructureTreelets(tree, cost, {.treelet_size = size, .rounds = rounds});
    return CostOf(cost, tree, tree.root);
  };
  EXPECT_LT(cost_after(7, 1), cost_after(5, 1));
  EXPECT_LT(cost_after(9, 1), cost_after(7, 1));
  EXPECT_LT(cost_after(7, 3), cost_after(7, 1));
}

TEST(TreeletTest, GrowingByTurnsSavesMore) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 20011, /*seed=*/7);
  const TreeletCost cost = MakeCost(photons, Heuristic::kIsa, LeafTerm::kLeafSize);
  LooseTree by_turns = Lbvh(photons, 2), by_measure = by_turns;
  RestructureTreelets(by_turns, cost, {.rounds = 3});
  for (int i = 0; i < 3; ++i) RestructureTreelets(by_measure, cost, {.rounds = 1});
  EXPECT_LT(CostOf(cost, by_turns, by_turns.root), CostOf(cost, by_measure, by_measure.root));
}

// A k-d tree may be as deep as kMaxDepth. Restructured, it is no deeper, and its cost falls.
TEST(TreeletTest, TheDepthIsBounded) {
  Photons photons;
  const std::uint32_t n = kMaxDepth + 1;
  std::mt19937 random(7);
  for (std::uint32_t i = 0; i < n; ++i) {
    const auto noise = [&] { return std::uniform_real_distribution<float>(0, 1)(random); };
    photons.positions.insert(photons.positions.end(),
                             {static_cast<float>(i) + noise(), noise(), noise()});
  }
  LooseTree chain;
  for (std::uint32_t i = 0; i < n; ++i) {
    const Vec3 p = photons.position(i);
    chain.photons.push_back({p.x, p.y, p.z, i});
  }
  chain.nodes.resize(n - 1);
  chain.root = MakeLeaf(chain.photons, n - 1, n);
  for (std::uint32_t i = n - 1; i-- > 0;) {
    const Subtree leaf = MakeLeaf(chain.photons, i, i + 1);
    chain.nodes[i] = {leaf, chain.root};
    chain.root = Join(i, leaf, chain.root);
  }
  ASSERT_EQ(chain.root.height, static_cast<std::uint32_t>(kMaxDepth));
  for (const TreeletMethod method :
       {TreeletMethod::kKdTree, TreeletMethod::kBvh, TreeletMethod::kAgglomerative}) {
    // Of sah, long chains are the cheapest trees of some of these boxes.
    for (const Heuristic heuristic : {Heuristic::kSah, Heuristic::kIsa}) {
      LooseTree tree = chain;
      const TreeletCost cost = MakeCost(photons, heuristic, LeafTerm::kNone);
      const double before = CostOf(cost, tree, tree.root);
      RestructureTreelets(tree, cost, {.method = method, .treelet_size = 7, .rounds = 3});
      EXPECT_LT(CostOf(cost, tree, tree.root), before);
      const Tree arranged = Arrange(tree, TreeKind::kBvh, 1);
      const absl::Status status = ValidateTree(arranged, photons);
      EXPECT_TRUE(status.ok()) << status;
    }
  }
}

// Boxes that no plane separates have no k-d tree: they become one leaf, or stay as they are.
TEST(TreeletTest, WhatNoPlaneSeparatesStaysOrBecomesALeaf) {
  Photons photons;
  const std::vector<Box> boxes = {{{0, 0, 0}, {0.6f, 0.3f, 1}},
                                  {{0.7f, 0, 0}, {1, 0.6f, 1}},
                                  {{0.4f, 0.7f, 0}, {1, 1, 1}},
                                  {{0, 0.4f, 0}, {0.3f, 1, 1}},
                                  {{0.4f, 0.4f, 0}, {0.6f, 0.6f, 1}}};
  LooseTree tree;
  constexpr std::uint32_t kPhotonsOfBox = 12;
  for (const Box& box : boxes) {
    for (std::uint32_t i = 0; i < kPhotonsOfBox; ++i) {
      const Vec3 p = i % 2 == 0 ? box.min : box.max;
      const auto id = static_cast<std::uint32_t>(tree.photons.size());
      photons.positions.insert(photons.positions.end(), {p.x, p.y, p.z});
      tree.photons.push_back({p.x, p.y, p.z, id});
    }
  }
  tree.nodes.resize(4);
  tree.root = MakeLeaf(tree.photons, 4 * kPhotonsOfBox, 5 * kPhotonsOfBox);
  for (std::uint32_t i = 4; i-- > 0;) {
    const Subtree leaf = MakeLeaf(tree.photons, i * kPhotonsOfBox, (i + 1) * kPhotonsOfBox);
    tree.nodes[i] = {leaf, tree.root};
    tree.root = Join(i, leaf, tree.root);
  }
  TreeletCost cost = MakeCost(photons, Heuristic::kIsa, LeafTerm::kNone);
  LooseTree stays = tree;
  RestructureTreelets(stays, cost, {.treelet_size = 7, .rounds = 2});
  EXPECT_TRUE(SameTree(Arrange(stays, TreeKind::kBvh, 12), Arrange(tree, TreeKind::kBvh, 12)));

  // As a BVH the five boxes are cheaper than as one leaf.
  cost.leaf_term = LeafTerm::kLeafSize;
  cost.max_leaf_size = 5 * kPhotonsOfBox;
  for (const auto& [method, kind, node_count] :
       {std::tuple(TreeletMethod::kKdTree, TreeKind::kKdTree, 0u),
        std::tuple(TreeletMethod::kBvh, TreeKind::kBvh, 4u)}) {
    LooseTree merges = tree;
    RestructureTreelets(merges, cost, {.method = method, .treelet_size = 7, .rounds = 2});
    const Tree arranged = Arrange(merges, kind, cost.max_leaf_size);
    EXPECT_EQ(arranged.nodes.size(), node_count);
    EXPECT_TRUE(ValidateTree(arranged, photons).ok());
  }
}

// Photons at 0, 5, 6, 20 and 25 of a line, as ((6 (20 25)) (0 5)). A treelet of four leaves opens
// the child with 6; then (0 5) and (20 25) are as long as each other, and (0 5) comes first in the
// list. So 5 meets 6; had (20 25) been opened, (0 5) would have stayed together.
TEST(TreeletTest, GrowsByTheFirstOfEqualMeasures) {
  Photons photons;
  LooseTree tree;
  for (const float x : {0.0f, 5.0f, 6.0f, 20.0f, 25.0f}) {
    tree.photons.push_back({x, 0, 0, static_cast<std::uint32_t>(photons.size())});
    photons.positions.insert(photons.positions.end(), {x, 0, 0});
  }
  const auto leaf = [&](std::uint32_t i) { return MakeLeaf(tree.photons, i, i + 1); };
  const Subtree low = Join(0, leaf(0), leaf(1)), high = Join(1, leaf(3), leaf(4));
  const Subtree six = Join(2, leaf(2), high);
  tree.nodes = {{leaf(0), leaf(1)}, {leaf(3), leaf(4)}, {leaf(2), high}, {six, low}};
  tree.root = Join(3, six, low);
  RestructureTreelets(tree, MakeCost(photons, Heuristic::kIsa, LeafTerm::kNone),
                      {.treelet_size = 4, .rounds = 1});
  const Tree arranged = Arrange(tree, TreeKind::kKdTree, 1);
  EXPECT_TRUE(ValidateTree(arranged, photons).ok());
  EXPECT_EQ(arranged.root.link, 2u);                // (0 5 6) (20 25)
  EXPECT_EQ(arranged.nodes[0].right, 1u);           // 0 (5 6)
  EXPECT_EQ(arranged.nodes[1].left, kLeafBit | 1);  // 5 6
  EXPECT_EQ(arranged.nodes[1].right, kLeafBit | 2);
}

TEST(LooseTreeTest, ArrangingALoosenedTreeGivesItBack) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {0, 1, 2, 9, 3001}) {
      const Photons photons = MakeCloud(shape, size, /*seed=*/7);
      const Tree tree = size == 0 ? Tree() : Arrange(Lbvh(photons, 8), TreeKind::kKdTree, 8);
      LooseTree loose = Loosen(tree);
      if (size > 0) {
        // The root's smallest index is not stored in a tree.
        EXPECT_EQ(loose.root.min_id, 0u);
      }
      EXPECT_TRUE(SameTree(Arrange(loose, TreeKind::kKdTree, 8), tree)) << shape.name;
    }
  }
}

}  // namespace
}  // namespace treelight
