#ifndef TREELIGHT_CORE_GPU_STATISTICS_H_
#define TREELIGHT_CORE_GPU_STATISTICS_H_

#include "core/gpu/hierarchy.h"

namespace treelight {

/// Statistics of `tree` over `leaf_count` leaves, at least one, as ComputeStatistics of
/// core/model/tree.h gives them; areas are summed in float (statistics.cl). Fills in what the host
/// needs to know of the tree, its root and its blocks. Waits.
TreeStatistics SumStatistics(const Gpu& gpu, std::size_t leaf_count, float radius,
                             DeviceTree& tree);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_STATISTICS_H_
