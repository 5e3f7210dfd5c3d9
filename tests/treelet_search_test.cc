#include "core/cpu/treelet_search.h"

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "gtest/gtest.h"

namespace treelight {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const Box kUnitCube{{0, 0, 0}, {1, 1, 1}};

TreeletCost MakeCost(Heuristic heuristic, LeafTerm leaf_term, std::uint32_t max_leaf_size) {
  return {Measure(heuristic, kUnitCube, 0.03f), leaf_term, max_leaf_size};
}

/// Leaves of a k-d tree: a box cut at random planes, then shrunk to what photons would fill.
std::vector<Subtree> RandomLeaves(std::uint32_t count, unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
  };
  std::vector<Box> cells = {kUnitCube};
  while (cells.size() < count) {
    Box& cell = cells[random() % cells.size()];
    const auto axis = random() % 3;
    Box other = cell;
    const float plane = uniform(Component(cell.min, static_cast<int>(axis)),
                                Component(cell.max, static_cast<int>(axis)));
    (axis == 0 ? cell.max.x : axis == 1 ? cell.max.y : cell.max.z) = plane;
    (axis == 0 ? other.min.x : axis == 1 ? other.min.y : other.min.z) = plane;
    cells.push_back(other);
  }
  std::vector<Subtree> leaves;
  for (const Box& cell : cells) {
    Subtree leaf;
    for (int corner = 0; corner < 2; ++corner) {
      leaf.box.Extend(Vec3{uniform(cell.min.x, cell.max.x), uniform(cell.min.y, cell.max.y),
                           uniform(cell.min.z, cell.max.z)});
    }
    leaf.count = 1 + random() % 4;
    leaves.push_back(leaf);
  }
  return leaves;
}

/// Leaf costs as restructuring sets them.
void SetCosts(const TreeletCost& cost, std::vector<Subtree>& leaves) {
  for (Subtree& leaf : leaves) {
    leaf.cost = cost.MayMerge(leaf.count) ? cost.Leaf(leaf.box, leaf.count) : 0.0f;
  }
}

Subtree Unite(const Subtree& a, const Subtree& b) {
  Subtree both{.box = a.box, .count = a.count + b.count};
  both.box.Extend(b.box);
  return both;
}

Subtree UniteAll(const std::vector<Subtree>& parts) {
  Subtree all = parts.front();
  for (const Subtree& part : parts) all.box.Extend(part.box);
  all.count = 0;
  for (const Subtree& part : parts) all.count += part.count;
  return all;
}

/// The least cost over all binary trees of `leaves`, by recursion over all partitions.
/// @param constrained  siblings must be separable
float ExhaustiveCost(const TreeletCost& cost, const std::vector<Subtree>& leaves,
                     bool constrained) {
  if (leaves.size() == 1) return leaves[0].cost;
  float best = kInfinity;
  for (std::uint32_t mask = 1; mask + 1 < 1u << leaves.size(); mask += 2) {
    std::vector<Subtree> a, b;
    for (std::size_t i = 0; i < leaves.size(); ++i) (mask >> i & 1 ? a : b).push_back(leaves[i]);
    if (constrained && !Separable(UniteAll(a).box, UniteAll(b).box)) continue;
    best =
        std::min(best, ExhaustiveCost(cost, a, constrained) + ExhaustiveCost(cost, b, constrained));
  }
  const Subtree all = UniteAll(leaves);
  return cost.Node(all.box, all.count, best).cost;
}

/// The cost of the tree that a plan describes, and whether the tree is one: every leaf once,
/// siblings separable where that is asked and they are not merged.
float PlanCost(const TreeletCost& cost, const TreeletPlan& plan, const std::vector<Subtree>& leaves,
               bool constrained) {
  std::vector<Subtree> parts = leaves;
  std::vector<int> uses(2 * leaves.size() - 1, 0);
  EXPECT_EQ(plan.joint_count, leaves.size() - 1);
  for (std::uint32_t j = 0; j < plan.joint_count; ++j) {
    const auto [left, right] = plan.joints[j];
    EXPECT_LT(left, parts.size());
    EXPECT_LT(right, parts.size());
    ++uses[left];
    ++uses[right];
    Subtree part = Unite(parts[left], parts[right]);
    const bool allowed = !constrained || Separable(parts[left].box, parts[right].box);
    const float below = allowed ? parts[left].cost + parts[right].cost : kInfinity;
    part.cost = cost.Node(part.box, part.count, below).cost;
    parts.push_back(part);
  }
  for (std::size_t i = 0; i + 1 < parts.size(); ++i) EXPECT_EQ(uses[i], 1) << i;
  return parts.back().cost;
}

using MakeSearch = std::unique_ptr<TreeletSearch> (*)(const TreeletCost&);

/// A search of the cheapest tree finds what exhaustive search finds, and plans it.
void ExpectCheapest(MakeSearch make, bool constrained, unsigned seed) {
  for (const Heuristic heuristic : {Heuristic::kSah, Heuristic::kIsa, Heuristic::kVvh}) {
    for (const LeafTerm leaf_term : {LeafTerm::kNone, LeafTerm::kLeafSize}) {
      const TreeletCost cost = MakeCost(heuristic, leaf_term, 8);
      const auto search = make(cost);  // the same for all treelets: it must forget
      for (const std::uint32_t size : {2u, 3u, 4u, 5u, 6u, 7u, 7u, 7u}) {
        auto leaves = RandomLeaves(size, seed++);
        SetCosts(cost, leaves);
        const TreeletPlan plan = search->Find(leaves);
        // All sums are of the same terms, but not in the same order where trees tie.
        ASSERT_NEAR(plan.cost, ExhaustiveCost(cost, leaves, constrained), 1e-6f * plan.cost);
        ASSERT_EQ(plan.cost, PlanCost(cost, plan, leaves, constrained));
      }
    }
  }
}

TEST(TreeletSearchTest, KdSearchFindsTheCheapestTree) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    ExpectCheapest(MakeKdTreeletSearch, /*constrained=*/true, 1000 * seed);
  }
}

TEST(TreeletSearchTest, BvhSearchFindsTheCheapestTree) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    ExpectCheapest(MakeBvhTreeletSearch, /*constrained=*/false, 1000 * seed);
  }
}

TEST(TreeletSearchTest, SearchesFindTheCheapestTreeOfFreshTreelets) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  ExpectCheapest(MakeKdTreeletSearch, /*constrained=*/true, seed);
  ExpectCheapest(MakeBvhTreeletSearch, /*constrained=*/false, seed);
}

TEST(TreeletSearchTest, LargerKdTreeletsAreNeverWorseThanAnyOtherPlan) {
  // 16 leaves are too many to try all trees: compare with the trees of random cuts.
  const TreeletCost cost = MakeCost(Heuristic::kIsa, LeafTerm::kNone, 8);
  const auto search = MakeKdTreeletSearch(cost);
  std::mt19937 random(7);
  for (unsigned seed = 0; seed < 30; ++seed) {
    auto leaves = RandomLeaves(16, seed);
    SetCosts(cost, leaves);
    const TreeletPlan plan = search->Find(leaves);
    ASSERT_EQ(plan.cost, PlanCost(cost, plan, leaves, /*constrained=*/true));
    const std::function<float(const std::vector<Subtree>&)> random_tree =
        [&](const std::vector<Subtree>& part) -> float {
      if (part.size() == 1) return part[0].cost;
      for (int attempt = 0; attempt < 50; ++attempt) {
        const int axis = static_cast<int>(random() % 3);
        const float plane = Component(part[random() % part.size()].box.max, axis);
        std::vector<Subtree> a, b;
        for (const Subtree& leaf : part) {
          (Component(leaf.box.max, axis) <= plane ? a : b).push_back(leaf);
        }
        if (b.empty() || !Separable(UniteAll(a).box, UniteAll(b).box)) continue;
        const Subtree all = UniteAll(part);
        return cost.Node(all.box, all.count, random_tree(a) + random_tree(b)).cost;
      }
      return kInfinity;
    };
    for (int i = 0; i < 100; ++i) ASSERT_LE(plan.cost, random_tree(leaves) * 1.00001f);
  }
}

/// Four boxes around a fifth, each reaching past the next: no plane separates any two parts.
std::vector<Subtree> Pinwheel() {
  std::vector<Subtree> leaves;
  for (const Box& box : {Box{{0, 0, 0}, {0.6f, 0.3f, 1}}, Box{{0.7f, 0, 0}, {1, 0.6f, 1}},
                         Box{{0.4f, 0.7f, 0}, {1, 1, 1}}, Box{{0, 0.4f, 0}, {0.3f, 1, 1}},
                         Box{{0.4f, 0.4f, 0}, {0.6f, 0.6f, 1}}}) {
    leaves.push_back({.box = box, .count = 1});
  }
  return leaves;
}

TEST(TreeletSearchTest, WhatNoPlaneSeparatesHasNoKdTree) {
  auto leaves = Pinwheel();
  const TreeletCost cost = MakeCost(Heuristic::kIsa, LeafTerm::kNone, 8);
  SetCosts(cost, leaves);
  EXPECT_EQ(MakeKdTreeletSearch(cost)->Find(leaves).cost, kInfinity);
  EXPECT_LT(MakeBvhTreeletSearch(cost)->Find(leaves).cost, kInfinity);
}

TEST(TreeletSearchTest, WhatNoPlaneSeparatesMayBeOneLeaf) {
  auto leaves = Pinwheel();
  for (const std::uint32_t max_leaf_size : {4u, 5u}) {
    const TreeletCost cost = MakeCost(Heuristic::kIsa, LeafTerm::kLeafSize, max_leaf_size);
    SetCosts(cost, leaves);
    const TreeletPlan plan = MakeKdTreeletSearch(cost)->Find(leaves);
    if (max_leaf_size < 5) {
      EXPECT_EQ(plan.cost, kInfinity);
    } else {
      EXPECT_EQ(plan.cost, cost.Leaf(kUnitCube, 5));
      EXPECT_EQ(plan.cost, PlanCost(cost, plan, leaves, /*constrained=*/true));
    }
  }
}

TEST(TreeletSearchTest, TouchingBoxesAreSeparable) {
  std::vector<Subtree> leaves = {{.box = {{0, 0, 0}, {0.5f, 1, 1}}, .count = 1},
                                 {.box = {{0.5f, 0, 0}, {0.5f, 1, 1}}, .count = 1},
                                 {.box = {{0.5f, 0, 0}, {1, 1, 1}}, .count = 1}};
  const TreeletCost cost = MakeCost(Heuristic::kSah, LeafTerm::kNone, 1);
  SetCosts(cost, leaves);
  const TreeletPlan plan = MakeKdTreeletSearch(cost)->Find(leaves);
  // The flat box goes with either side.
  EXPECT_FLOAT_EQ(plan.cost, cost.measure(kUnitCube) + cost.measure({{0, 0, 0}, {0.5f, 1, 1}}));
}

// Two patches of a floor and what stands on both: a cut between floor and the rest is cheapest by
// area, but all of the floor would touch the rest.
TEST(TreeletSearchTest, PartsThatTouchAreTheLastResort) {
  const Box left_floor = {{0, 0, 0}, {0.4f, 0, 1}}, right_floor = {{0.6f, 0, 0}, {1, 0, 1}};
  const Box left_thing = {{0.1f, 0, 0.1f}, {0.4f, 0.2f, 0.9f}},
            right_thing = {{0.6f, 0, 0.1f}, {0.9f, 0.2f, 0.9f}};
  std::vector<Subtree> leaves;
  for (const Box& box : {left_floor, right_floor, left_thing, right_thing}) {
    leaves.push_back({.box = box, .count = 1});
  }
  const TreeletCost cost = MakeCost(Heuristic::kSah, LeafTerm::kNone, 1);
  SetCosts(cost, leaves);
  const TreeletPlan plan = MakeKdTreeletSearch(cost)->Find(leaves);
  ASSERT_EQ(plan.joint_count, 3u);
  // First left from right, where a plane lies between; within each the floor touches the thing.
  std::vector<Subtree> parts = leaves;
  for (std::uint32_t j = 0; j < plan.joint_count; ++j) {
    parts.push_back(Unite(parts[plan.joints[j].left], parts[plan.joints[j].right]));
  }
  const auto [left, right] = plan.joints[2];
  EXPECT_EQ(parts[left].box, (Box{{0, 0, 0}, {0.4f, 0.2f, 1}}));
  EXPECT_EQ(parts[right].box, (Box{{0.6f, 0, 0}, {1, 0.2f, 1}}));
}

TEST(TreeletSearchTest, AgglomerationJoinsTheNearestFirst) {
  // On a line at 0, 1, 10, 12: (0 1), then (10 12), then both.
  std::vector<Subtree> leaves;
  for (const float x : {0.0f, 10.0f, 1.0f, 12.0f}) {
    leaves.push_back({.box = {{x, 0, 0}, {x, 0, 0}}, .count = 1});
  }
  const TreeletCost cost{Measure(Heuristic::kIsa, {{0, 0, 0}, {12, 0, 0}}, 0.1f), LeafTerm::kNone,
                         1};
  SetCosts(cost, leaves);
  const TreeletPlan plan = MakeAgglomerativeTreeletSearch(cost)->Find(leaves);
  ASSERT_EQ(plan.joint_count, 3u);
  const std::vector<std::vector<int>> expected = {{0, 2}, {1, 3}, {4, 5}};
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_EQ((std::vector<int>{plan.joints[j].left, plan.joints[j].right}), expected[j]);
  }
  EXPECT_EQ(plan.cost, PlanCost(cost, plan, leaves, /*constrained=*/false));
}

TEST(TreeletSearchTest, AgglomerationIsNeverCheaperThanTheCheapestBvh) {
  const TreeletCost cost = MakeCost(Heuristic::kSah, LeafTerm::kNone, 8);
  const auto agglomerate = MakeAgglomerativeTreeletSearch(cost);
  const auto cheapest = MakeBvhTreeletSearch(cost);
  for (unsigned seed = 0; seed < 50; ++seed) {
    auto leaves = RandomLeaves(8, seed);
    SetCosts(cost, leaves);
    const TreeletPlan plan = agglomerate->Find(leaves);
    ASSERT_EQ(plan.cost, PlanCost(cost, plan, leaves, /*constrained=*/false));
    ASSERT_GE(plan.cost, cheapest->Find(leaves).cost * 0.99999f);
  }
}

}  // namespace
}  // namespace treelight
