#ifndef TREELIGHT_CORE_GPU_LEAVES_H_
#define TREELIGHT_CORE_GPU_LEAVES_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/kernels/types.h"

namespace treelight {

struct Leaves {
  std::size_t leaf_count = 0;
  Buffer<cl_uint>
      firsts;  ///< [leaf_count + 1] first photon of each leaf in leaf order, then the photon count
  bool is_tied = false;  ///< there are no leaves yet: photons are still to be told apart
};

/// Lists the leaves where `flags` [count + 1] are 1 and the last of them is 0; uses the flags up.
/// Waits.
Leaves ListLeaves(const Gpu& gpu, const Buffer<cl_uint>& flags, std::size_t count);

/// Finds the maximal subtrees of at most `max_leaf_size` of `count` photons (leaves.cl). Waits.
Leaves FindLeaves(const Gpu& gpu, const Buffer<cl_uchar>& levels, std::size_t count,
                  std::uint32_t max_leaf_size);

/// The same, where levels may still be tied, as `is_tied` [1] on the device says: both are learnt
/// in one wait.
Leaves FindLeaves(const Gpu& gpu, const Buffer<cl_uchar>& levels, std::size_t count,
                  std::uint32_t max_leaf_size, const Buffer<cl_uint>& is_tied);

/// Copies the photons to leaf order, `ids` [count] (leaves.cl). Does not wait.
Buffer<LeafPhoton> PermutePhotons(const Gpu& gpu, const Buffer<float>& positions,
                                  const Buffer<cl_uint>& ids, std::size_t count);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_LEAVES_H_
