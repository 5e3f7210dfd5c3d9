#include "core/gpu/wide_tree.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>

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

/// Appends the first members of the largest subtrees of at most 32 of the members [begin, end):
/// recursion over the smallest level of a range, the last of several. `meets` [i]: level between
/// members i and i + 1.
void ListNodes(const std::vector<std::uint8_t>& meets, std::uint32_t begin, std::uint32_t end,
               std::vector<std::uint32_t>& nodes) {
  if (end - begin <= 32) return nodes.push_back(begin);
  std::uint32_t lowest = begin;
  for (std::uint32_t i = begin; i + 1 < end; ++i)
    if (meets[i] <= meets[lowest]) lowest = i;
  ListNodes(meets, begin, lowest + 1, nodes);
  ListNodes(meets, lowest + 1, end, nodes);
}

/// Where more than 4 nodes begin among 32 neighbours, these become one node.
std::vector<std::uint32_t> WithoutSmallNodes(const std::vector<std::uint32_t>& nodes,
                                             std::size_t member_count) {
  std::vector<std::uint32_t> kept;
  bool many_before = false;
  auto next = nodes.begin();
  for (std::uint32_t begin = 0; begin < member_count; begin += 32) {
    const auto end = std::lower_bound(next, nodes.end(), begin + 32);
    const bool many = end - next > 4;
    if (many || many_before) kept.push_back(begin);
    if (!many)
      std::copy(next + (many_before && next != end && *next == begin), end,
                std::back_inserter(kept));
    many_before = many;
    next = end;
  }
  return kept;
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
    for (const std::size_t size : {1, 31, 32, 33, 1024, 1025, 50021, 300007}) {
      for (const std::uint32_t max_leaf_size : {1u, 16u, 64u}) {
        if (size > 100000 && max_leaf_size != 16) continue;
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
        const auto levels = Upload(cloud.levels);
        DeviceTree device_tree = BuildHierarchy(TestGpu(), levels, leaves, Upload(photons));
        SumStatistics(TestGpu(), leaves.leaf_count, /*radius=*/0.1f, device_tree);
        const DeviceWideTree wide = BuildWideTree(TestGpu(), device_tree, leaves, levels);
        const auto boxes = wide.boxes.Read(TestGpu().queue());
        const WideSizes sizes = wide.sizes.Read(TestGpu().queue())[0];
        std::vector<std::uint32_t> members =
            ends;  // of each box: its first member below, then the end
        for (std::uint32_t level = 0;; ++level) {
          ASSERT_LT(level, sizes.level_count);
          ASSERT_EQ(sizes.counts[level], ends.size() - 1) << "level " << level;
          for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
            const WideBox& box = boxes[wide.shape.offsets[level] + i];
            ASSERT_TRUE(SameBox(box, BoxOf(photons, ends[i], ends[i + 1]))) << level << " " << i;
            ASSERT_EQ(box.first, members[i]) << level << " " << i;
          }
          ASSERT_EQ(boxes[wide.shape.offsets[level] + ends.size() - 1].first, members.back());
          if (ends.size() - 1 <= 32) {
            ASSERT_EQ(sizes.level_count, level + 1);
            break;
          }
          const auto member_count = static_cast<std::uint32_t>(ends.size() - 1);
          std::vector<std::uint8_t> meets;
          for (std::size_t i = 1; i < member_count; ++i) meets.push_back(cloud.levels[ends[i] - 1]);
          std::vector<std::uint32_t> nodes;
          ListNodes(meets, 0, member_count, nodes);
          members = WithoutSmallNodes(nodes, member_count);
          members.push_back(member_count);
          std::vector<std::uint32_t> above;
          for (const std::uint32_t member : members) above.push_back(ends[member]);
          ends = above;
        }
      }
    }
  }
}

}  // namespace
}  // namespace treelight
