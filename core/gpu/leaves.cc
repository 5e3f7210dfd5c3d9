#include "core/gpu/leaves.h"

#include "core/gpu/scan.h"

namespace treelight {

Leaves ListLeaves(const Gpu& gpu, const Buffer<cl_uint>& flags, std::size_t count) {
  ExclusiveScan(gpu, flags, count + 1);
  const cl_uint leaf_count = flags.ReadAt(gpu.queue(), count);
  Leaves leaves{leaf_count, Buffer<cl_uint>(gpu.memory(), leaf_count + std::size_t{1})};
  Launch(gpu, gpu.stages, "leaf_firsts", count + 1, kGroupSize, flags.get(),
         static_cast<cl_uint>(count), leaves.firsts.get());
  return leaves;
}

Leaves FindLeaves(const Gpu& gpu, const Buffer<cl_uchar>& levels, std::size_t count,
                  std::uint32_t max_leaf_size) {
  const Buffer<cl_uint> flags(gpu.memory(), count + 1);
  Launch(gpu, gpu.stages, "leaf_flags", count + 1, kGroupSize, levels.get(),
         static_cast<cl_uint>(count), max_leaf_size, flags.get());
  return ListLeaves(gpu, flags, count);
}

Buffer<LeafPhoton> PermutePhotons(const Gpu& gpu, const Buffer<float>& positions,
                                  const Buffer<cl_uint>& ids, std::size_t count) {
  Buffer<LeafPhoton> photons(gpu.memory(), count);
  Launch(gpu, gpu.stages, "leaf_photons", count, kGroupSize, positions.get(), ids.get(),
         static_cast<cl_uint>(count), photons.get());
  return photons;
}

}  // namespace treelight
