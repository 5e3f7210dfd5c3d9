#ifndef TREELIGHT_CORE_GPU_SWEEP_H_
#define TREELIGHT_CORE_GPU_SWEEP_H_

#include <cstdint>

#include "core/builder.h"
#include "core/gpu/placed_photons.h"
#include "core/model/heuristic.h"

namespace treelight {

/// Rebuilds every leaf of `tree` of more than `max_leaf_size` photons, at most `subtree_size`
/// <= MaxDeviceSubtree, by a sweep (sweep.cl). Waits.
PlacedPhotons SweepSubtrees(const Gpu& gpu, PlacedPhotons tree, std::uint32_t subtree_size,
                            const Measure& measure, LeafTerm leaf_term,
                            std::uint32_t max_leaf_size);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_SWEEP_H_
