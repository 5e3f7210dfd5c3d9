#ifndef TREELIGHT_CORE_BUILD_COSTS_H_
#define TREELIGHT_CORE_BUILD_COSTS_H_

#include <array>
#include <cstddef>
#include <cstdint>

#include "absl/status/statusor.h"
#include "core/builder.h"

namespace treelight {

/// A tree that BuildChooser may take.
struct TreeCandidate {
  BuilderKind builder = BuilderKind::kLbvh;
  std::uint32_t max_leaf_size = 16;
};

/// Those that were the fastest somewhere, over devices, sets, sizes and kinds of gathers:
/// docs/performance.md.
inline constexpr std::array<TreeCandidate, 4> kTreeCandidates = {{{BuilderKind::kLbvh, 16},
                                                                  {BuilderKind::kLbvh, 32},
                                                                  {BuilderKind::kLbvh, 64},
                                                                  {BuilderKind::kHybrid, 32}}};

/// T of the hybrid among them.
inline constexpr std::uint32_t kCandidateSubtree = 512;

/// What a candidate costs on a device, microseconds.
struct TreeCosts {
  double build_us = 0;   ///< of a build, however small
  double photon_us = 0;  ///< of a build, for each photon
  double gather_us = 0;  ///< of a gather in a large batch
};

/// What builds and gathers cost on a device.
struct BuildCosts {
  std::array<TreeCosts, kTreeCandidates.size()> trees{};
  double long_code_us = 0;    ///< of codes of 63 bits instead of 30, for each photon
  double shared_cell_us = 0;  ///< of a photon that shares its cell with many
};

/// Measures on the device of `builder`, by builds of up to 131 072 photons on the faces of a cube
/// and gathers of the `k` nearest; k 0: of all within a radius that holds 50. Takes 0.1 to 0.5 s.
/// The errors of Builder::Build and Gatherer::Gather.
absl::StatusOr<BuildCosts> MeasureBuildCosts(Builder& builder, std::uint32_t k,
                                             const CancelCheck& cancelled = {});

}  // namespace treelight

#endif  // TREELIGHT_CORE_BUILD_COSTS_H_
