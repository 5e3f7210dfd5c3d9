#include "core/gpu/bounds.h"

#include <algorithm>

namespace treelight {

Box ComputeBounds(const Gpu& gpu, const Buffer<float>& positions, std::size_t count) {
  if (count == 0) return {};
  // Enough groups to fill a device, few enough that one group can reduce their boxes.
  const std::size_t group_count = std::min<std::size_t>(
      (count + kGroupSize - 1) / kGroupSize, std::size_t{8} * gpu.device->info().compute_units);
  const Buffer<float> boxes(gpu.memory(), 6 * group_count);
  const Buffer<float> bounds(gpu.memory(), 6);
  Launch(gpu, gpu.stages, "bounds_of_photons", group_count * kGroupSize, kGroupSize,
         positions.get(), static_cast<cl_uint>(count), boxes.get());
  Launch(gpu, gpu.stages, "bounds_of_boxes", kGroupSize, kGroupSize, boxes.get(),
         static_cast<cl_uint>(group_count), bounds.get());
  const std::vector<float> b = bounds.Read(gpu.queue());
  return {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
}

}  // namespace treelight
