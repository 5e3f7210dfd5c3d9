#ifndef TREELIGHT_CORE_MERGED_GATHER_H_
#define TREELIGHT_CORE_MERGED_GATHER_H_

#include <cstdint>

#include "absl/status/statusor.h"
#include "core/gatherer.h"

// Gathers from fewer photons that carry the light of all (model/merge_photons.h), on any device.
namespace treelight {

/// Merged photons that an answer is made of, at least; a query that finds fewer is answered
/// exactly, which costs little there, and without which a few dark places would make most of the
/// error of a batch.
inline constexpr std::uint32_t kFewestMergedPhotons = 12;

/// Photons that one merged photon stands for, mean.
double GroupSize(const Gatherer& map, const Gatherer& merged);

/// The merged photons that k photons become, at least 1.
std::uint32_t MergedK(std::uint32_t k, double group_size);

/// What is gathered exactly for an answer that may be merged: with counts.
GatherOptions ExactOptions(const GatherOptions& options);

/// Answers `queries` from `merged`, a merged map of `map`: all within the radius where k is 0, else
/// as many as k photons are merged into; counts are those of merged photons times the photons that
/// one stands for. Queries that find fewer than kFewestMergedPhotons are answered exactly;
/// GatherResult::merged says which are not. The errors of Gatherer::Gather.
absl::StatusOr<GatherResult> GatherMerged(const Gatherer& map, const Gatherer& merged,
                                          const GatherQueries& queries,
                                          const GatherOptions& options,
                                          const CancelCheck& cancelled = {});

}  // namespace treelight

#endif  // TREELIGHT_CORE_MERGED_GATHER_H_
