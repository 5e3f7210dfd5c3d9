#ifndef TREELIGHT_CORE_GPU_MORTON_H_
#define TREELIGHT_CORE_GPU_MORTON_H_

#include "core/gpu/radix_sort.h"
#include "core/kernels/types.h"

namespace treelight {

/// Writes the Morton code of each of `count` points in `positions` [3 * count] to the keys, 30-bit
/// codes where Key is cl_uint and 63-bit where it is cl_ulong, and 0, 1, 2, ... to the values
/// (morton.cl); `grid` [1] is one of as many bits. Does not wait.
template <typename Key>
void ComputeMortonCodes(const Gpu& gpu, const Buffer<float>& positions, std::size_t count,
                        const Buffer<MortonGrid>& grid, const KeyValues<Key>& codes) {
  Launch(gpu, gpu.stages, sizeof(Key) == 8 ? "morton_codes_63" : "morton_codes_30", count,
         kGroupSize, positions.get(), grid.get(), static_cast<cl_uint>(count), codes.keys.get(),
         codes.values.get());
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_MORTON_H_
