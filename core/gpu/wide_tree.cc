#include "core/gpu/wide_tree.h"

#include <vector>

#include "core/gpu/scan.h"

namespace treelight {
namespace {

// Members of a work-group; the kernels' NODE_TILE.
constexpr cl_uint kNodeTile = kGroupSize - 64;

// From so many members on, work-groups share the work of a level.
constexpr cl_uint kSharedMembers = 8192;

/// How many boxes each level has at most, where at most `max_begins` nodes begin among 32 members
/// that are neighbours, and one more where nodes of others end.
std::vector<cl_uint> BoundLevels(cl_uint block_count, cl_uint max_begins) {
  std::vector<cl_uint> bounds = {block_count};
  while (bounds.back() > kSubGroupSize) {
    bounds.push_back((bounds.back() + kSubGroupSize - 1) / kSubGroupSize * (max_begins + 1));
  }
  return bounds;
}

}  // namespace

DeviceWideTree BuildWideTree(const Gpu& gpu, const DeviceTree& tree, const Leaves& leaves,
                             const Buffer<cl_uchar>& levels) {
  DeviceWideTree wide;
  const cl_uint block_count = tree.block_count;
  if (block_count > kMaxWideBlocks) return wide;
  // As many begins as leave no more levels than there may be.
  cl_uint max_begins = 4;
  std::vector<cl_uint> bounds = BoundLevels(block_count, max_begins);
  while (bounds.size() > kMaxWideLevels) bounds = BoundLevels(block_count, --max_begins);
  cl_uint size = 0;
  for (std::size_t level = 0; level < bounds.size(); ++level) {
    wide.shape.offsets[level] = size;
    size += bounds[level] + 1;
  }
  wide.boxes = Buffer<WideBox>(gpu.memory(), size);
  wide.sizes = Buffer<WideSizes>(gpu.memory(), 1);
  const Buffer<cl_uchar> meets(gpu.memory(), std::size_t{2} * block_count);

  const auto leaf_count = static_cast<cl_uint>(leaves.leaf_count);
  ExclusiveScan(gpu, tree.block_flags, leaf_count + std::size_t{1});
  const cl::Program& program = gpu.sub_group_stages;
  Launch(gpu, program, "wide_block_firsts", leaf_count + std::size_t{1}, kGroupSize,
         tree.block_flags.get(), leaves.firsts.get(), leaf_count, levels.get(), wide.boxes.get(),
         meets.get(), wide.sizes.get());
  Launch(gpu, program, "wide_blocks", std::size_t{block_count} * kSubGroupSize, kGroupSize,
         tree.photons.get(), block_count, wide.boxes.get());
  cl_uint level = 0;
  for (; bounds[level] > kSharedMembers; ++level) {
    const std::size_t tiles = (bounds[level] + kNodeTile - 1) / kNodeTile;
    const Buffer<cl_uint> counts(gpu.memory(), tiles);
    Launch(gpu, program, "wide_counts", tiles * kGroupSize, kGroupSize, meets.get(), block_count,
           wide.sizes.get(), level, max_begins, counts.get());
    Launch(gpu, program, "wide_nodes", tiles * kGroupSize, kGroupSize, wide.boxes.get(), wide.shape,
           meets.get(), block_count, wide.sizes.get(), level, max_begins, counts.get());
  }
  if (bounds[level] > kSubGroupSize) {
    Launch(gpu, program, "wide_top", kGroupSize, kGroupSize, wide.boxes.get(), wide.shape,
           meets.get(), block_count, wide.sizes.get(), level, max_begins);
  }
  return wide;
}

}  // namespace treelight
