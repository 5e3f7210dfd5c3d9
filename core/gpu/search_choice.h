#ifndef TREELIGHT_CORE_GPU_SEARCH_CHOICE_H_
#define TREELIGHT_CORE_GPU_SEARCH_CHOICE_H_

#include <string_view>

#include "core/gatherer.h"

namespace treelight {

/// How an OpenCL device searches for a batch, by the names of the kernels.
enum class DeviceSearch {
  kGatherNearest,  ///< the k nearest in a heap for each work-item
  kGatherWide,     ///< the k nearest in lists of sub-groups, in the wide tree
  kGatherLong,     ///< likewise, a sub-group for each query: for large k
  kGatherList,     ///< all within a radius, counted and then listed
  kGatherSums,     ///< densities within a radius, whole subtrees added up
  kCountWide,      ///< counts within a radius by sub-groups, in the wide tree
  kDensityWide,    ///< densities within a radius by sub-groups, in the wide tree
  kGatherRange,    ///< counts and densities within a radius by a work-item each
};

struct SearchChoice {
  DeviceSearch search = DeviceSearch::kGatherRange;
  std::string_view reason;  ///< "gather_wide: ...", for people; static text
};

/// The fastest kernel that answers `options` in a map: docs/performance.md.
/// @param has_wide_tree  that sub-groups walk; not every device has sub-groups of 32
/// @param has_powers     else densities are 0 without a search
SearchChoice ChooseSearch(const GatherOptions& options, bool has_wide_tree, bool has_powers);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_SEARCH_CHOICE_H_
