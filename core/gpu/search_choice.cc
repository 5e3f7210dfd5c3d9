#include "core/gpu/search_choice.h"

#include <cstdint>

#include "core/gpu/gpu.h"

namespace treelight {
namespace {

// From this k on, sub-groups are faster than a heap for each work-item.
constexpr std::uint32_t kMinWideK = 17;
static_assert(kMaxWideK == 64);  // which the texts name

SearchChoice ChooseNearest(const GatherOptions& options, bool has_wide_tree) {
  using enum DeviceSearch;
  if (!has_wide_tree) {
    return {kGatherNearest, "gather_nearest: this device has no sub-groups of 32"};
  }
  if ((options.outputs & kOutputStatistics) != 0) {
    return {kGatherNearest, "gather_nearest: it counts what it visits, for STATISTICS"};
  }
  if (options.approximation.any()) {
    return {kGatherNearest, "gather_nearest: gather_wide is always exact"};
  }
  if (options.k < kMinWideK) {
    return {kGatherNearest, "gather_nearest: k is at most 16, a heap for each work-item is faster"};
  }
  if (options.k > kMaxWideK) {
    return {kGatherLong, "gather_long: k is above 64, each query has a sub-group of its own"};
  }
  return {kGatherWide, "gather_wide: k is in [17, 64], lists of sub-groups are faster"};
}

}  // namespace

SearchChoice ChooseSearch(const GatherOptions& options, bool has_wide_tree, bool has_powers) {
  using enum DeviceSearch;
  if (options.k > 0) return ChooseNearest(options, has_wide_tree);
  if ((options.outputs & kOutputNeighbors) != 0) {
    return {kGatherList, "gather_list: k is 0, lists of any length are counted, then filled"};
  }
  if (options.approximation.weight_tolerance > 0 && has_powers) {
    return {kGatherSums, "gather_sums: whole subtrees may be added up"};
  }
  if ((options.outputs & kOutputStatistics) != 0) {
    return {kGatherRange, "gather_range: it counts what it visits, for STATISTICS"};
  }
  if (!has_wide_tree) {
    return {kGatherRange, "gather_range: this device has no sub-groups of 32"};
  }
  if ((options.outputs & kOutputDensity) != 0 && has_powers) {
    return {kDensityWide, "density_wide: k is 0, densities are added up by sub-groups"};
  }
  return {kCountWide, "count_wide: counts without densities, by sub-groups"};
}

}  // namespace treelight
