#include "core/gpu/leaves.h"

#include <vector>

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
                  std::uint32_t max_leaf_size, const Buffer<cl_uint>& is_tied) {
  const std::size_t group_count = (count + kGroupSize - 1) / kGroupSize;
  const Buffer<cl_uint> marks(gpu.memory(), group_count * kGroupSize / 32);
  const Buffer<cl_uint> counts(gpu.memory(), group_count + 2);
  const auto n = static_cast<cl_uint>(count);
  Launch(gpu, gpu.stages, "leaf_marks", count, kGroupSize, levels.get(), n, max_leaf_size,
         is_tied.get(), marks.get(), counts.get());
  ExclusiveScan(gpu, counts, group_count + 1);
  const std::vector<cl_uint> totals = counts.Read(gpu.queue(), 2, group_count);
  Leaves leaves{totals[0], Buffer<cl_uint>(gpu.memory(), totals[0] + std::size_t{1}),
                is_tied.size() > 0 && totals[1] != 0};
  if (leaves.is_tied) return leaves;
  Launch(gpu, gpu.stages, "marked_firsts", count, kGroupSize, marks.get(), counts.get(), n,
         leaves.firsts.get());
  return leaves;
}

Leaves FindLeaves(const Gpu& gpu, const Buffer<cl_uchar>& levels, std::size_t count,
                  std::uint32_t max_leaf_size) {
  return FindLeaves(gpu, levels, count, max_leaf_size, Buffer<cl_uint>(gpu.memory(), 0));
}

Buffer<LeafPhoton> PermutePhotons(const Gpu& gpu, const Buffer<float>& positions,
                                  const Buffer<cl_uint>& ids, std::size_t count) {
  Buffer<LeafPhoton> photons(gpu.memory(), count);
  Launch(gpu, gpu.stages, "leaf_photons", count, kGroupSize, positions.get(), ids.get(),
         static_cast<cl_uint>(count), photons.get());
  return photons;
}

}  // namespace treelight
