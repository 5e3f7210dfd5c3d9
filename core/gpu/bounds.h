#ifndef TREELIGHT_CORE_GPU_BOUNDS_H_
#define TREELIGHT_CORE_GPU_BOUNDS_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/model/box.h"

namespace treelight {

/// Tight box of the `count` points in `positions` [3 * count]; empty where count is 0 (bounds.cl).
/// Waits.
Box ComputeBounds(const Gpu& gpu, const Buffer<float>& positions, std::size_t count);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_BOUNDS_H_
