#ifndef TREELIGHT_CORE_GPU_HIERARCHY_H_
#define TREELIGHT_CORE_GPU_HIERARCHY_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/gpu/leaves.h"
#include "core/kernels/types.h"
#include "core/model/tree.h"

namespace treelight {

/// The tree on the device; core/model/tree.h says what the arrays hold.
struct DeviceTree {
  Root root{};
  Buffer<Node> nodes;          ///< [leaf_count - 1]
  Buffer<cl_uint> min_ids;     ///< [2 * nodes]
  Buffer<LeafPhoton> photons;  ///< [n]
  Buffer<cl_ulong>
      climbs;  ///< [leaf_count] for the statistics of the build; may be dropped after them
  Buffer<cl_uint> block_flags;  ///< [leaf_count + 1] for BuildWideTree, which uses them up
  Buffer<Root> device_root;     ///< [1]
  cl_uint block_count = 0;      ///< of the wide tree
};

/// Builds the tree over `leaves` of `photons` in leaf order, at least one, from the split levels
/// (hierarchy.cl). Does not wait: `root` and `block_count` are known after SumStatistics.
DeviceTree BuildHierarchy(const Gpu& gpu, const Buffer<cl_uchar>& levels, const Leaves& leaves,
                          Buffer<LeafPhoton> photons);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_HIERARCHY_H_
