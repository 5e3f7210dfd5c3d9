#ifndef TREELIGHT_CORE_GPU_SPLIT_LEVELS_H_
#define TREELIGHT_CORE_GPU_SPLIT_LEVELS_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// Computes the level [count - 1] of the boundary between each two neighbours of the ascending
/// `codes` [count], 30-bit where Key is cl_uint and 63-bit where it is cl_ulong; kLevelTied where
/// they are equal (split_levels.cl). Does not wait.
template <typename Key>
void ComputeSplitLevels(const Gpu& gpu, const Buffer<Key>& codes, std::size_t count,
                        const Buffer<cl_uchar>& levels) {
  Launch(gpu, gpu.stages, sizeof(Key) == 8 ? "split_levels_63" : "split_levels_30", count,
         kGroupSize, codes.get(), static_cast<cl_uint>(count), levels.get());
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_SPLIT_LEVELS_H_
