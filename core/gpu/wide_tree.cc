#include "core/gpu/wide_tree.h"

#include "core/gpu/scan.h"

namespace treelight {

DeviceWideTree BuildWideTree(const Gpu& gpu, const DeviceTree& tree, const Leaves& leaves) {
  const auto leaf_count = static_cast<cl_uint>(leaves.leaf_count);
  ExclusiveScan(gpu, tree.block_flags, leaf_count + std::size_t{1});
  const cl_uint block_count = tree.block_count;
  DeviceWideTree wide;
  WideTree& shape = wide.shape;
  cl_uint count = block_count, size = 0;
  while (true) {
    shape.offsets[shape.level_count] = size;
    shape.counts[shape.level_count] = count;
    size += count + (shape.level_count == 0 ? 1 : 0);
    ++shape.level_count;
    if (count <= kSubGroupSize) break;
    count = (count + kSubGroupSize - 1) / kSubGroupSize;
  }
  wide.boxes = Buffer<WideBox>(gpu.memory(), size);
  Launch(gpu, gpu.sub_group_stages, "wide_block_firsts", leaf_count + std::size_t{1}, kGroupSize,
         tree.block_flags.get(), leaves.firsts.get(), leaf_count, wide.boxes.get());
  Launch(gpu, gpu.sub_group_stages, "wide_blocks", std::size_t{block_count} * kSubGroupSize,
         kGroupSize, tree.photons.get(), block_count, wide.boxes.get());
  for (cl_uint level = 1; level < shape.level_count; ++level) {
    Launch(gpu, gpu.sub_group_stages, "wide_level",
           std::size_t{shape.counts[level]} * kSubGroupSize, kGroupSize, wide.boxes.get(),
           shape.offsets[level - 1], shape.counts[level - 1], shape.offsets[level]);
  }
  return wide;
}

}  // namespace treelight
