#include "core/gpu/scan.h"

namespace treelight {

void ExclusiveScan(const Gpu& gpu, const Buffer<cl_uint>& values, std::size_t count) {
  constexpr std::size_t kTile = kGroupSize * kScanItems;
  if (count == 0) return;
  const std::size_t tile_count = (count + kTile - 1) / kTile;
  const Buffer<cl_uint> sums(gpu.memory(), tile_count);
  const auto n = static_cast<cl_uint>(count);
  Launch(gpu, gpu.stages, "scan_tiles", tile_count * kGroupSize, kGroupSize, values.get(), n,
         sums.get());
  if (tile_count == 1) return;
  ExclusiveScan(gpu, sums, tile_count);
  Launch(gpu, gpu.stages, "scan_add", tile_count * kGroupSize, kGroupSize, values.get(), n,
         sums.get());
}

}  // namespace treelight
