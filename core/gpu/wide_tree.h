#ifndef TREELIGHT_CORE_GPU_WIDE_TREE_H_
#define TREELIGHT_CORE_GPU_WIDE_TREE_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/gpu/hierarchy.h"
#include "core/gpu/leaves.h"
#include "core/kernels/types.h"

namespace treelight {

/// The tree that sub-groups walk, derived from the binary one (wide_tree.cl).
struct DeviceWideTree {
  WideTree shape{};
  Buffer<WideBox> boxes;    ///< none where there are no photons, or no sub-groups on the device
  Buffer<WideSizes> sizes;  ///< [1]
};

/// Builds the wide tree of `tree`, whose leaves are `leaves`, whose split levels are `levels` and
/// whose statistics are summed; none of more than kMaxWideBlocks. Does not wait.
DeviceWideTree BuildWideTree(const Gpu& gpu, const DeviceTree& tree, const Leaves& leaves,
                             const Buffer<cl_uchar>& levels);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_WIDE_TREE_H_
