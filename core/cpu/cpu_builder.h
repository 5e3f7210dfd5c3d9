#ifndef TREELIGHT_CORE_CPU_CPU_BUILDER_H_
#define TREELIGHT_CORE_CPU_CPU_BUILDER_H_

#include <cstdint>
#include <vector>

#include "core/builder.h"

namespace treelight {

/// Photons of a leaf of the lbvh whose treelets are restructured: B, or with the leaf term, which
/// merges leaves, B / 4 and at least 1. Leaves of one photon give the same tree quality to within
/// half a percent of the nodes visited, and take two to five times as long; leaves of B / 2 lose
/// two percent.
std::uint32_t TreeletInputLeafSize(const BuildOptions& options);

/// The tree of `options` over checked photons [3n].
/// @param radius  gather radius of isa and vvh, scene units
Tree BuildCpuTree(const std::vector<float>& positions, const BuildOptions& options, float radius);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_CPU_BUILDER_H_
