#ifndef TREELIGHT_CORE_GPU_BOUNDS_H_
#define TREELIGHT_CORE_GPU_BOUNDS_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/kernels/types.h"
#include "core/model/box.h"

namespace treelight {

/// The tight box of some points, on the device, and the grids of Morton codes over it.
struct DeviceBounds {
  Buffer<float> box;           ///< [6] minimum, maximum, scene units
  Buffer<MortonGrid> grid_30;  ///< [1] of 30-bit codes
  Buffer<MortonGrid> grid_63;  ///< [1] of 63-bit codes

  /// Waits.
  Box ReadBox(const Gpu& gpu) const;
};

/// Of the `count` points in `positions` [3 * count]; the box is empty where count is 0 (bounds.cl).
/// Does not wait.
DeviceBounds ComputeBounds(const Gpu& gpu, const Buffer<float>& positions, std::size_t count);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_BOUNDS_H_
