#include "core/cpu/sweep.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "gtest/gtest.h"
#include "tests/clouds.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

/// The sweep again: every cut tried with boxes computed afresh, no order kept between nodes.
class PlainSweep {
 public:
  PlainSweep(const std::vector<float>& positions, const Measure& measure,
             std::uint32_t max_leaf_size, LeafTerm leaf_term)
      : positions_(positions),
        measure_(measure),
        max_leaf_size_(max_leaf_size),
        leaf_term_(leaf_term) {}

  LooseTree Build() {
    tree_.nodes.resize(positions_.size() / 3 - 1);
    std::vector<std::uint32_t> ids(positions_.size() / 3);
    std::iota(ids.begin(), ids.end(), 0u);
    tree_.root = Build(ids);
    return tree_;
  }

 private:
  Vec3 At(std::uint32_t id) const {
    const float* p = &positions_[3 * std::size_t{id}];
    return {p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f};
  }

  float Cost(const std::vector<std::uint32_t>& ids) const {
    Box box;
    for (const std::uint32_t id : ids) box.Extend(At(id));
    const double n = static_cast<double>(ids.size());
    const double units = leaf_term_ == LeafTerm::kLeafSize ? std::ceil(n / max_leaf_size_) : n;
    return measure_(box) * static_cast<float>(units);
  }

  Subtree Build(std::vector<std::uint32_t> ids) {
    if (ids.size() <= max_leaf_size_) {
      const auto first = static_cast<std::uint32_t>(tree_.photons.size());
      std::sort(ids.begin(), ids.end(), [&](std::uint32_t a, std::uint32_t b) {
        return At(a).x < At(b).x || (At(a).x == At(b).x && a < b);
      });
      for (const std::uint32_t id : ids)
        tree_.photons.push_back({At(id).x, At(id).y, At(id).z, id});
      return MakeLeaf(tree_.photons, first, first + static_cast<std::uint32_t>(ids.size()));
    }
    float best = std::numeric_limits<float>::infinity();
    std::size_t best_imbalance = 0;
    float best_extent = 0;
    std::vector<std::uint32_t> best_left, best_right;
    for (int axis = 0; axis < 3; ++axis) {
      std::sort(ids.begin(), ids.end(), [&](std::uint32_t a, std::uint32_t b) {
        return std::pair(Component(At(a), axis), a) < std::pair(Component(At(b), axis), b);
      });
      const float extent = Component(At(ids.back()), axis) - Component(At(ids.front()), axis);
      for (std::size_t cut = 1; cut < ids.size(); ++cut) {
        const std::vector<std::uint32_t> left(ids.begin(), ids.begin() + static_cast<int>(cut));
        const std::vector<std::uint32_t> right(ids.begin() + static_cast<int>(cut), ids.end());
        const float cost = Cost(left) + Cost(right);
        const std::size_t imbalance =
            std::max(left.size(), right.size()) - std::min(left.size(), right.size());
        if (cost < best || (cost == best && imbalance < best_imbalance) ||
            (cost == best && imbalance == best_imbalance && extent > best_extent)) {
          best = cost;
          best_extent = extent;
          best_imbalance = imbalance;
          best_left = left;
          best_right = right;
        }
      }
    }
    const Subtree left = Build(best_left), right = Build(best_right);
    tree_.nodes[next_] = {left, right};
    return Join(next_++, left, right);
  }

  const std::vector<float>& positions_;
  const Measure measure_;
  const std::uint32_t max_leaf_size_;
  const LeafTerm leaf_term_;
  LooseTree tree_;
  std::uint32_t next_ = 0;
};

Box BoxOf(const Photons& photons) {
  Box box;
  for (std::size_t i = 0; i < photons.size(); ++i) box.Extend(photons.position(i));
  return box;
}

Tree BuildSweep(const Photons& photons, const Measure& measure, std::uint32_t max_leaf_size,
                LeafTerm leaf_term) {
  SweepSplitter splitter(measure, max_leaf_size, leaf_term);
  const PhotonRange all{0, static_cast<std::uint32_t>(photons.size()), 0};
  splitter.Begin(all, AllPhotons(photons.positions));
  return Arrange(TopDown(max_leaf_size, splitter).Build(all), TreeKind::kKdTree, max_leaf_size);
}

void ExpectPlainTree(const Photons& photons, const std::string& name) {
  for (const Heuristic heuristic : {Heuristic::kSah, Heuristic::kIsa, Heuristic::kVvh}) {
    const Measure measure(heuristic, BoxOf(photons), 0.02f);
    for (const LeafTerm leaf_term : {LeafTerm::kNone, LeafTerm::kLeafSize}) {
      for (const std::uint32_t max_leaf_size : {1u, 8u}) {
        const Tree plain =
            Arrange(PlainSweep(photons.positions, measure, max_leaf_size, leaf_term).Build(),
                    TreeKind::kKdTree, max_leaf_size);
        ASSERT_TRUE(SameTree(BuildSweep(photons, measure, max_leaf_size, leaf_term), plain))
            << name << " " << photons.size() << " leaf " << max_leaf_size;
      }
    }
  }
}

TEST(SweepTest, AgreesWithThePlainSweep) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 2, 3, 8, 9, 16, 17, 101}) {
      ExpectPlainTree(MakeCloud(shape, size, /*seed=*/7), shape.name);
    }
  }
}

TEST(SweepTest, AgreesWithThePlainSweepOnFreshClouds) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  for (const CloudShape& shape : AllClouds()) {
    ExpectPlainTree(MakeCloud(shape, 50 + seed % 50, seed), shape.name);
  }
}

// Where the depth runs out, halves; else one far photon is cut off.
TEST(SweepTest, HalvesWhereTheDepthRunsOut) {
  Photons photons;
  for (const float x : {0.0f, 1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f, 1000.0f}) {
    photons.positions.insert(photons.positions.end(), {x, x, x});
  }
  for (const auto& [depth, left_count] :
       {std::pair(0u, 7u), std::pair(kMaxDepth - 4u, 7u), std::pair(kMaxDepth - 3u, 4u)}) {
    SweepSplitter splitter(Measure(Heuristic::kSah, BoxOf(photons), 0), /*max_leaf_size=*/1,
                           LeafTerm::kNone);
    const PhotonRange range{0, 8, depth};
    splitter.Begin(range, AllPhotons(photons.positions));
    EXPECT_EQ(splitter.Split(range).first.count(), left_count) << depth;
  }
}

TEST(TopDownTest, RangesThatMustBeHalvedFitTheDepth) {
  for (const std::uint32_t max_leaf_size : {1u, 3u, 8u, 64u}) {
    for (const std::uint32_t count : {1u, 7u, 8u, 9u, 1000u, 1'000'000u, 100'000'000u}) {
      // From the first depth at which halving is forced, halving ends at kMaxDepth at the latest.
      PhotonRange range{0, count, 0};
      while (!MustHalve(range, max_leaf_size)) ++range.depth;
      while (range.count() > max_leaf_size) {
        range.last = range.first + WholeLeavesMedian(range.count(), max_leaf_size);
        ++range.depth;
      }
      EXPECT_LE(range.depth, static_cast<std::uint32_t>(kMaxDepth)) << count;
    }
  }
}

}  // namespace
}  // namespace treelight
