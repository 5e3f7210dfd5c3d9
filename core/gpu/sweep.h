#ifndef TREELIGHT_CORE_GPU_SWEEP_H_
#define TREELIGHT_CORE_GPU_SWEEP_H_

#include <cstdint>

#include "core/gpu/placed_photons.h"
#include "core/model/heuristic.h"

namespace treelight {

/// Photons of a subtree, at most: what fits the local memory of a work-group.
inline constexpr std::uint32_t kMaxSweptSubtree = 1024;

/// Rebuilds every leaf of `tree` of more than `max_leaf_size` photons, at most `subtree_size`
/// <= kMaxSweptSubtree, by a sweep (sweep.cl). Waits.
PlacedPhotons SweepSubtrees(const Gpu& gpu, PlacedPhotons tree, std::uint32_t subtree_size,
                            const Measure& measure, LeafTerm leaf_term,
                            std::uint32_t max_leaf_size);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_SWEEP_H_
