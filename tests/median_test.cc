#include "core/cpu/median.h"

#include <algorithm>
#include <functional>

#include "core/builder.h"
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

}  // namespace
}  // namespace treelight
