#include "core/gpu/hierarchy.h"

#include <utility>

namespace treelight {

DeviceTree BuildHierarchy(const Gpu& gpu, const Buffer<cl_uchar>& levels, const Leaves& leaves,
                          Buffer<LeafPhoton> photons) {
  const std::size_t node_count = leaves.leaf_count - 1;
  DeviceTree tree{{},
                  Buffer<Node>(gpu.memory(), node_count),
                  Buffer<cl_uint>(gpu.memory(), 2 * node_count),
                  std::move(photons),
                  Buffer<cl_ulong>(gpu.memory(), leaves.leaf_count),
                  Buffer<cl_uint>(gpu.memory(), leaves.leaf_count + std::size_t{1}),
                  Buffer<Root>(gpu.memory(), 1)};
  const Buffer<cl_uchar> heights(gpu.memory(), 2 * node_count);
  const Buffer<cl_uint> meetings(gpu.memory(), node_count);
  meetings.Fill(gpu.queue(), kNoPhoton);  // NOBODY
  Launch(gpu, gpu.stages, "hierarchy", leaves.leaf_count, kGroupSize, levels.get(),
         leaves.firsts.get(), static_cast<cl_uint>(leaves.leaf_count), tree.photons.get(),
         meetings.get(), tree.nodes.get(), tree.min_ids.get(), heights.get(), tree.climbs.get(),
         tree.block_flags.get(), tree.device_root.get());
  return tree;
}

}  // namespace treelight
