#include "core/gpu/gpu.h"

#include <string>
#include <string_view>
#include <vector>

#include "fmt/format.h"

namespace treelight {

Gpu OpenGpu(std::size_t index, const DeviceOptions& options) {
  Gpu gpu;
  gpu.device = Device::Open(index, options);
  Device& device = *gpu.device;
  const std::string group =
      fmt::format("-DGROUP_SIZE={} -DSCAN_ITEMS={} -DSORT_ITEMS={} -DTIE_ITEMS={}", kGroupSize,
                  kScanItems, kSortItems, kTieItems);
  gpu.stages = device.Program({"bounds.cl", "morton.cl", "query_order.cl", "split_levels.cl",
                               "ties.cl", "scan.cl", "large_subtree.cl", "leaves.cl", "meeting.cl",
                               "hierarchy.cl", "statistics.cl", "photon_powers.cl"},
                              group);
  if (device.has_sub_groups()) {
    const std::string tile = fmt::format("-DSWEEP_SUB_GROUPS={}", kSweepGroupSize / kSubGroupSize);
    const auto sort = [&]<typename Key>(Key) {
      return device.Program(
          {"sub_group.cl", "radix_sort_onesweep.cl"},
          fmt::format("{} -DSWEEP_ITEMS={} -DKEY_BITS={}", tile, kSweepItems<Key>, 8 * sizeof(Key)),
          {"sweep_pass", kSweepResident<Key>});
    };
    gpu.sort_32 = sort(cl_uint{});
    gpu.sort_64 = sort(cl_ulong{});
  } else {
    gpu.sort_32 = device.Program({"scan.cl", "radix_sort.cl"}, group + " -DKEY_BITS=32");
    gpu.sort_64 = device.Program({"scan.cl", "radix_sort.cl"}, group + " -DKEY_BITS=64");
  }
  gpu.gather = device.Program({"traverse.cl", "heap.cl", "gather_nearest.cl", "gather_range.cl"},
                              "-DHEAP_SPACE=local");
  gpu.gather_global =
      device.Program({"traverse.cl", "heap.cl", "gather_nearest.cl", "gather_list.cl"},
                     "-DHEAP_SPACE=global -DHEAPS_GLOBAL=1");
  if (!device.has_sub_groups()) return gpu;
  gpu.sub_group_stages = device.Program(
      {"morton.cl", "ties.cl", "sub_group.cl", "ties_short.cl", "large_subtree.cl", "wide_tree.cl"},
      fmt::format("-DSUB_GROUPS={} -DTIE_SHORT_RUN={} -DTIE_BOUNDARIES={}", kSubGroupsPerGroup,
                  kTieShortRun, kTieBoundaries));
  const auto wide = [&](const std::vector<std::string_view>& files, std::string_view kernel,
                        const WideVariants& variants) {
    const auto variant = [&](const WideVariant& of) {
      return device.Program(
          files, fmt::format("-DQUERIES={} -DSUB_GROUPS={}", of.queries, kSubGroupsPerGroup),
          {std::string(kernel), of.resident});
    };
    return WidePrograms{variant(variants.many), variant(variants.few)};
  };
  gpu.gather_wide =
      wide({"traverse.cl", "sub_group.cl", "wide_walk.cl", "candidate_list.cl", "gather_wide.cl"},
           "gather_wide", kGatherWideVariants);
  gpu.count_wide = wide({"traverse.cl", "sub_group.cl", "wide_walk.cl", "count_wide.cl"},
                        "count_wide", kCountWideVariants);
  gpu.density_wide = wide({"traverse.cl", "sub_group.cl", "wide_walk.cl", "density_wide.cl"},
                          "density_wide", kDensityWideVariants);
  const auto gather_long = [&](std::size_t sub_groups, unsigned resident) {
    return device.Program({"traverse.cl", "sub_group.cl", "long_list.cl", "gather_long.cl"},
                          fmt::format("-DSUB_GROUPS={}", sub_groups), {"gather_long", resident});
  };
  gpu.gather_long = gather_long(1, 0);
  gpu.gather_long_pairs = gather_long(2, kLongPairsResident);
  return gpu;
}

}  // namespace treelight
