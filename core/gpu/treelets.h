#ifndef TREELIGHT_CORE_GPU_TREELETS_H_
#define TREELIGHT_CORE_GPU_TREELETS_H_

#include <cstdint>

#include "core/cpu/treelet.h"
#include "core/gpu/hierarchy.h"
#include "core/gpu/placed_photons.h"

namespace treelight {

/// RestructureTreelets of core/cpu/treelet.h (treelet_round.cl): the same tree, in leaf order
/// (arrange.cl). Waits. CANCELLED is thrown as StatusError where `cancelled` says so, asked before
/// each round.
/// @param tree    of BuildHierarchy over `leaves`; its nodes are used up
/// @param levels  [n - 1] of the same; overwritten
PlacedPhotons RestructureTreelets(const Gpu& gpu, const DeviceTree& tree, const Leaves& leaves,
                                  Buffer<cl_uchar> levels, const TreeletCost& cost,
                                  const TreeletOptions& options, const CancelCheck& cancelled);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_TREELETS_H_
