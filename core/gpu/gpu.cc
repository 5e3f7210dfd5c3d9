#include "core/gpu/gpu.h"

#include "fmt/format.h"

namespace treelight {

Gpu OpenGpu(const DeviceOptions& options) {
  Gpu gpu;
  gpu.device = Device::Open(options);
  Device& device = *gpu.device;
  const std::string group =
      fmt::format("-DGROUP_SIZE={} -DSCAN_ITEMS={} -DSORT_ITEMS={} -DTIE_ITEMS={}", kGroupSize,
                  kScanItems, kSortItems, kTieItems);
  gpu.stages = device.Program({"bounds.cl", "morton.cl", "split_levels.cl", "ties.cl", "scan.cl",
                               "leaves.cl", "hierarchy.cl", "statistics.cl"},
                              group);
  gpu.sort_32 = device.Program({"scan.cl", "radix_sort.cl"}, group + " -DKEY_BITS=32");
  gpu.sort_64 = device.Program({"scan.cl", "radix_sort.cl"}, group + " -DKEY_BITS=64");
  gpu.gather = device.Program({"traverse.cl", "heap.cl", "gather_nearest.cl", "gather_range.cl"},
                              "-DHEAP_SPACE=local");
  gpu.gather_global =
      device.Program({"traverse.cl", "heap.cl", "gather_nearest.cl", "gather_list.cl"},
                     "-DHEAP_SPACE=global -DHEAPS_GLOBAL=1");
  return gpu;
}

}  // namespace treelight
