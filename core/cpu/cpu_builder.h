#ifndef TREELIGHT_CORE_CPU_CPU_BUILDER_H_
#define TREELIGHT_CORE_CPU_CPU_BUILDER_H_

#include <cstdint>
#include <vector>

#include "core/builder.h"
#include "core/cpu/treelet.h"

namespace treelight {

/// Photons of a leaf of the lbvh whose treelets are restructured: B, or with the leaf term, which
/// merges leaves, B / 4 and at least 1. Leaves of one photon give the same tree quality to within
/// half a percent of the nodes visited, and take two to five times as long; leaves of B / 2 lose
/// two percent.
std::uint32_t TreeletInputLeafSize(const BuildOptions& options);

/// How treelets are restructured, where they are.
TreeletOptions TreeletOptionsOf(const BuildOptions& options);

/// Whether the builder of `options` takes a gather radius.
bool NeedsRadius(const BuildOptions& options);

/// Host memory that BuildMeasuredCpuTree takes for so many photons, with the tree, bytes, a little
/// more rather than less.
std::uint64_t CpuBuildBytes(const BuildOptions& options, std::uint64_t photon_count);

struct MeasuredCpuTree {
  Tree tree;
  float radius = 0;               ///< of the options; sampled where that is 0 and one is needed
  std::vector<StageTime> stages;  ///< "radius" where it is sampled, "tree"
};

/// The tree of `options` over checked photons [3n], with a radius sampled where isa or vvh needs
/// one and none is given (gather_radius.h). CANCELLED: `cancelled` said so, which is asked between
/// passes over the photons and at each subtree of thousands.
absl::StatusOr<MeasuredCpuTree> BuildMeasuredCpuTree(const std::vector<float>& positions,
                                                     const BuildOptions& options,
                                                     const CancelCheck& cancelled);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_CPU_BUILDER_H_
