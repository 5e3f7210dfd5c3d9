#include "core/gpu/wide_tree.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/gpu/hierarchy.h"
#include "core/gpu/statistics.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

/// Appends the first photons of the blocks below a child of `tree`: of the largest subtrees of at
/// most kBlockSize photons, and of leaves of more.
void ListBlocks(const Tree& tree, std::uint32_t link, std::uint32_t count,
                std::vector<std::uint32_t>& firsts) {
  const auto first_photon = [&] {
    std::uint32_t child = link;
    while ((child & kLeafBit) == 0) child = tree.nodes[child].left;
    return child & ~kLeafBit;
  };
  if (count <= kBlockSize || (link & kLeafBit) != 0) return firsts.push_back(first_photon());
  const Node& node = tree.nodes[link];
  ListBlocks(tree, node.left, node.left_count, firsts);
  ListBlocks(tree, node.right, node.right_count, firsts);
}

/// The box of photons [first, last) of a tree.
WideBox BoxOf(const std::vector<LeafPhoton>& photons, std::uint32_t first, std::uint32_t last) {
  WideBox box{{INFINITY, INFINITY, INFINITY}, kNoPhoton, {-INFINITY, -INFINITY, -INFINITY}, first};
  for (std::uint32_t i = first; i < last; ++i) {
    const float p[3] = {photons[i].x, photons[i].y, photons[i].z};
    for (int c = 0; c < 3; ++c) {
      box.min[c] = std::min(box.min[c], p[c]);
      box.max[c] = std::max(box.max[c], p[c]);
    }
    box.min_id = std::min(box.min_id, photons[i].id);
  }
  return box;
}

bool SameBox(const WideBox& a, const WideBox& b) {
  return std::memcmp(a.min, b.min, sizeof a.min) == 0 &&
         std::memcmp(a.max, b.max, sizeof a.max) == 0 && a.min_id == b.min_id;
}

TEST(WideTreeTest, KernelsAgreeWithReference) {
  if (!TestGpu().device->has_sub_groups()) GTEST_SKIP() << "the test device has no sub-groups";
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 31, 32, 33, 1024, 1025, 50021}) {
      for (const std::uint32_t max_leaf_size : {1u, 16u, 64u}) {
        SCOPED_TRACE(shape.name + " " + std::to_string(size));
        SortedCloud cloud = SortCloud(shape, size, 30);
        reference::BreakTies(cloud.positions, 30, max_leaf_size, cloud.ids, cloud.levels);
        const auto firsts = reference::LeafFirsts(cloud.levels, size, max_leaf_size);
        const auto photons = InLeafOrder(cloud);
        const Tree tree = reference::Hierarchy(cloud.levels, firsts, photons, max_leaf_size);
        std::vector<std::uint32_t>
            ends;  // photon ranges of a level's boxes, [ends[i], ends[i + 1])
        ListBlocks(tree, tree.root.link, tree.root.count, ends);
        ends.push_back(static_cast<std::uint32_t>(size));

        const Leaves leaves{firsts.size() - 1, Upload(firsts)};
        DeviceTree device_tree =
            BuildHierarchy(TestGpu(), Upload(cloud.levels), leaves, Upload(photons));
        SumStatistics(TestGpu(), leaves.leaf_count, /*radius=*/0.1f, device_tree);
        const DeviceWideTree wide = BuildWideTree(TestGpu(), device_tree, leaves);
        const auto boxes = wide.boxes.Read(TestGpu().queue());
        for (std::uint32_t level = 0;; ++level) {
          ASSERT_LT(level, wide.shape.level_count);
          ASSERT_EQ(wide.shape.counts[level], ends.size() - 1);
          for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
            const WideBox& box = boxes[wide.shape.offsets[level] + i];
            ASSERT_TRUE(SameBox(box, BoxOf(photons, ends[i], ends[i + 1]))) << level << " " << i;
            if (level == 0) {
              ASSERT_EQ(box.first, ends[i]);
            }
          }
          if (level == 0) {
            ASSERT_EQ(boxes[ends.size() - 1].first, size);
          }
          if (ends.size() - 1 <= 32) {
            ASSERT_EQ(wide.shape.level_count, level + 1);
            break;
          }
          std::vector<std::uint32_t> above;
          for (std::size_t i = 0; i + 1 < ends.size(); i += 32) above.push_back(ends[i]);
          above.push_back(ends.back());
          ends = above;
        }
      }
    }
  }
}

}  // namespace
}  // namespace treelight
