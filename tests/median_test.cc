#include "core/cpu/median.h"

#include <algorithm>
#include <functional>

#include "core/builder.h"
#include "core/cpu/sliding_midpoint.h"
#include "gtest/gtest.h"
#include "tests/clouds.h"

namespace treelight {
namespace {

Tree Build(const Photons& photons, const BuildOptions& options) {
  return *(*MakeCpuBuilder()->Build(photons, options))->ReadTree();
}

using Key = std::pair<float, std::uint32_t>;

/// Calls `visit` with the node and the (coordinate on its widest axis, index) of the photons on
/// both of its sides. Returns the photons below the link.
std::vector<LeafPhoton> ForEachNode(
    const Tree& tree, std::uint32_t link, std::uint32_t count,
    const std::function<void(const std::vector<Key>&, const std::vector<Key>&)>& visit) {
  if ((link & kLeafBit) != 0) {
    const auto first = tree.photons.begin() + (link & ~kLeafBit);
    return {first, first + count};
  }
  const Node& node = tree.nodes[link];
  std::vector<LeafPhoton> left = ForEachNode(tree, node.left, node.left_count, visit);
  const std::vector<LeafPhoton> right = ForEachNode(tree, node.right, node.right_count, visit);
  Box box;
  for (const LeafPhoton& p : left) box.Extend(Vec3{p.x, p.y, p.z});
  for (const LeafPhoton& p : right) box.Extend(Vec3{p.x, p.y, p.z});
  const Vec3 extent{box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z};
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const auto keys = [axis](const std::vector<LeafPhoton>& photons) {
    std::vector<Key> list;
    for (const LeafPhoton& p : photons) list.emplace_back(Component({p.x, p.y, p.z}, axis), p.id);
    return list;
  };
  visit(keys(left), keys(right));
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

TEST(MedianTest, EveryNodeHalvesItsWidestAxis) {
  for (const CloudShape& shape : AllClouds()) {
    const Photons photons = MakeCloud(shape, 1009, /*seed=*/7);
    const Tree tree = Build(
        photons,
        {.builder = BuilderKind::kBalanced, .max_leaf_size = 8, .leaf_term = LeafTerm::kNone});
    ForEachNode(tree, tree.root.link, tree.root.count, [&](const auto& left, const auto& right) {
      ASSERT_EQ(left.size(), (left.size() + right.size() + 1) / 2);
      ASSERT_LT(*std::max_element(left.begin(), left.end()),
                *std::min_element(right.begin(), right.end()))
          << shape.name;
    });
    EXPECT_EQ(tree.root.depth, 7u);  // 1009 / 2^7 < 8
  }
}

TEST(MedianTest, WholeLeavesAreFullButOne) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 1009, /*seed=*/7);
  const Tree tree = Build(photons, {.builder = BuilderKind::kBalanced, .max_leaf_size = 8});
  EXPECT_EQ(tree.nodes.size() + 1, 127u);
  EXPECT_EQ(ComputeStatistics(tree).leaf_fill, 1009.0 / 127);
}

/// The places after which the root of a sliding midpoint tree over points of a line is cut.
std::uint32_t FirstCut(const std::vector<float>& line) {
  std::vector<float> positions;
  for (const float x : line) positions.insert(positions.end(), {x, 0, 0});
  SlidingMidpointSplitter splitter(positions, /*max_leaf_size=*/1);
  return splitter.Split(splitter.Root(static_cast<std::uint32_t>(line.size()))).first.last;
}

TEST(SlidingMidpointTest, CutsTheMiddleOfTheCell) {
  EXPECT_EQ(FirstCut({0, 1, 2, 3, 4, 100}), 5u);
  EXPECT_EQ(FirstCut({0, 96, 97, 98, 99, 100}), 1u);
  EXPECT_EQ(FirstCut({0, 1, 2, 3}), 2u);
}

// Maneewongvatana and Mount 1999, figure 2: a cell with all points in one half.
TEST(SlidingMidpointTest, SlidesToTheNearestPhoton) {
  std::vector<float> positions;
  for (const float x : {0.0f, 1.0f, 1.0f, 2.0f, 100.0f}) {
    positions.insert(positions.end(), {x, 0, 0});
  }
  SlidingMidpointSplitter splitter(positions, /*max_leaf_size=*/1);
  const auto [low, high] = splitter.Split(splitter.Root(5));
  ASSERT_EQ(low.count(), 4u);
  EXPECT_EQ(low.cell.max.x, 50.0f);
  // The middle of [0, 50] is 25: the plane slides down to 2, which alone goes right.
  const auto [left, right] = splitter.Split(low);
  EXPECT_EQ(left.count(), 3u);
  EXPECT_EQ(left.cell.max.x, 2.0f);
  EXPECT_EQ(right.cell.min.x, 2.0f);
  EXPECT_EQ(right.cell.max.x, 50.0f);
}

TEST(SlidingMidpointTest, PhotonsOfAPlaneAreNotCutOffOneByOne) {
  const Photons photons = MakeCloud(CloudNamed("coplanar"), 5003, /*seed=*/7);
  const Tree tree = Build(photons, {.builder = BuilderKind::kSlidingMidpoint, .max_leaf_size = 8});
  EXPECT_LT(tree.root.depth, 25u);
}

}  // namespace
}  // namespace treelight
