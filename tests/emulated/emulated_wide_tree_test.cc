// The kernels of wide_tree.cl on the host (work_group.h), against the reference.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/gpu/gpu.h"
#include "gtest/gtest.h"
#include "tests/emulated/wide_tree.h"
#include "tests/emulated/work_group.h"
#include "tests/reference.h"
#include "tests/same_wide_tree.h"
#include "tests/test_device.h"
#include "tests/wide_reference.h"

namespace treelight::emulated {
namespace {

static_assert(kGroupSize == 256);                   // GROUP_SIZE of wide_tree.cl
constexpr std::size_t kNodeTile = kGroupSize - 64;  // NODE_TILE of wide_tree.cl
constexpr std::uint32_t kMaxBegins = 4;             // as BuildWideTree, but for huge trees

void Launch(void (*kernel)(const WideTreeArguments*), const WideTreeArguments& arguments,
            std::size_t items) {
  RunWorkGroups((items + kGroupSize - 1) / kGroupSize, kGroupSize / kSubGroupSize,
                [&] { kernel(&arguments); });
}

/// For each leaf, and behind them, how many blocks begin before it.
std::vector<std::uint32_t> BlocksBefore(const std::vector<std::uint32_t>& leaf_firsts,
                                        const reference::WideReference& wide) {
  std::vector<std::uint32_t> places;
  std::uint32_t block = 0;
  for (const std::uint32_t first : leaf_firsts) {
    places.push_back(block);
    if (block < wide.sizes.counts[0] && wide.boxes[block].first == first) ++block;
  }
  return places;
}

/// Builds the wide tree over the leaves, its levels by many work-groups up to `shared_levels`, the
/// others by one, and compares.
void ExpectReference(const SortedCloud& cloud, const std::vector<std::uint32_t>& firsts,
                     const std::vector<LeafPhoton>& photons,
                     const reference::WideReference& expected, std::uint32_t shared_levels) {
  const std::vector<std::uint32_t> places = BlocksBefore(firsts, expected);
  const std::uint32_t blocks = expected.sizes.counts[0];
  std::vector<WideBox> boxes(kMaxWideLevels * (blocks + 2));
  std::vector<std::uint8_t> meets(2 * blocks);
  std::vector<std::uint32_t> counts(blocks / kNodeTile + 1);
  WideSizes sizes{};
  WideTreeArguments arguments{.places = places.data(),
                              .firsts = firsts.data(),
                              .leaf_count = static_cast<std::uint32_t>(firsts.size() - 1),
                              .levels = cloud.levels.data(),
                              .photons = photons.data(),
                              .boxes = boxes.data(),
                              .tree = {},
                              .meets = meets.data(),
                              .stride = blocks,
                              .sizes = &sizes,
                              .level = 0,
                              .max_begins = kMaxBegins,
                              .counts = counts.data()};
  for (std::uint32_t level = 0; level < kMaxWideLevels; ++level)
    arguments.tree.offsets[level] = level * (blocks + 2);
  Launch(run_wide_block_firsts, arguments, firsts.size());
  Launch(run_wide_blocks, arguments, blocks * kSubGroupSize);
  for (; arguments.level < shared_levels && sizes.counts[arguments.level] > kSubGroupSize;
       ++arguments.level) {
    const std::size_t tiles = counts.size();  // more than there are
    Launch(run_wide_counts, arguments, tiles * kGroupSize);
    Launch(run_wide_nodes, arguments, tiles * kGroupSize);
  }
  Launch(run_wide_top, arguments, kGroupSize);
  EXPECT_TRUE(SameWideTree(boxes, arguments.tree, sizes, expected));
}

void CheckCloud(const CloudShape& shape, std::size_t size, std::uint32_t max_leaf_size) {
  SCOPED_TRACE(shape.name + " " + std::to_string(size) + " photons, leaves of " +
               std::to_string(max_leaf_size));
  SortedCloud cloud = SortCloud(shape, size, 30);
  reference::BreakTies(cloud.positions, 30, max_leaf_size, cloud.ids, cloud.levels);
  const auto firsts = reference::LeafFirsts(cloud.levels, size, max_leaf_size);
  const auto photons = InLeafOrder(cloud);
  const auto expected = reference::MakeWideTree(
      reference::Hierarchy(cloud.levels, firsts, photons, max_leaf_size), cloud.levels);
  for (const std::uint32_t shared_levels : {0u, 9u})
    ExpectReference(cloud, firsts, photons, expected, shared_levels);
}

TEST(EmulatedWideTreeTest, KernelsAgreeWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 31, 32, 33, 1024, 1025, 10007})
      for (const std::uint32_t max_leaf_size : {1u, 16u, 64u})
        CheckCloud(shape, size, max_leaf_size);
  }
}

/// Nodes that are neighbours and no subtree have nodes above them.
TEST(EmulatedWideTreeTest, UnevenTreesOfManyLevelsAgreeWithReference) {
  CheckCloud(CloudNamed("half_one_duplicate"), 300007, 16);
}

}  // namespace
}  // namespace treelight::emulated
