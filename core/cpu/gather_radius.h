#ifndef TREELIGHT_CORE_CPU_GATHER_RADIUS_H_
#define TREELIGHT_CORE_CPU_GATHER_RADIUS_H_

#include <cstdint>
#include <vector>

#include "core/cpu/loose_tree.h"

namespace treelight {

/// Queries that a gather radius is sampled from.
inline constexpr std::uint32_t kRadiusSamples = 101;

/// Neighbours of such a query.
inline constexpr std::uint32_t kRadiusNeighbors = 50;

/// The photons that are the queries: kRadiusSamples indices below `photon_count`, drawn with
/// replacement, index i by a hash of seed and i (the output of PCG, Jarzynski and Olano 2020, "Hash
/// Functions for GPU Rendering") modulo `photon_count`, which is not 0.
std::vector<std::uint32_t> SamplePhotons(std::uint32_t photon_count, std::uint32_t seed);

/// The median of distances: of m in ascending order, number m / 2 from 0. Distances of 0 are left
/// out, since photons with so many duplicates tell nothing of the others; 0 where none is left.
float MedianRadius(std::vector<float> radii);

/// The MedianRadius over the sampled photons of the distance to the kRadiusNeighbors-th photon,
/// itself included, or to the farthest where there are fewer. Scene units.
/// @param tree  a k-d tree over all of `positions` [3n], without merged nodes
float SampleGatherRadius(const LooseTree& tree, const std::vector<float>& positions,
                         std::uint32_t seed);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_GATHER_RADIUS_H_
