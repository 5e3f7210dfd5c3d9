#include "core/gpu/bounds.h"

#include <algorithm>
#include <vector>

namespace treelight {

Box DeviceBounds::ReadBox(const Gpu& gpu) const {
  const std::vector<float> b = box.Read(gpu.queue());
  return {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
}

DeviceBounds ComputeBounds(const Gpu& gpu, const Buffer<float>& positions, std::size_t count) {
  // Enough groups to fill a device, few enough that one group can reduce their boxes.
  const std::size_t group_count = std::min<std::size_t>(
      (count + kGroupSize - 1) / kGroupSize, std::size_t{8} * gpu.device->info().compute_units);
  const Buffer<float> boxes(gpu.memory(), 6 * group_count);
  DeviceBounds bounds{Buffer<float>(gpu.memory(), 6), Buffer<MortonGrid>(gpu.memory(), 1),
                      Buffer<MortonGrid>(gpu.memory(), 1)};
  Launch(gpu, gpu.stages, "bounds_of_photons", group_count * kGroupSize, kGroupSize,
         positions.get(), static_cast<cl_uint>(count), boxes.get());
  Launch(gpu, gpu.stages, "bounds_of_boxes", kGroupSize, kGroupSize, boxes.get(),
         static_cast<cl_uint>(group_count), bounds.box.get(), bounds.grid_30.get(),
         bounds.grid_63.get());
  return bounds;
}

}  // namespace treelight
