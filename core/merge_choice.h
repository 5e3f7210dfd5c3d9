#ifndef TREELIGHT_CORE_MERGE_CHOICE_H_
#define TREELIGHT_CORE_MERGE_CHOICE_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/gather_costs.h"
#include "core/gatherer.h"
#include "core/merged_gather.h"

// How few photons a batch may do with: what Approximation::max_relative_error leaves to the server.
namespace treelight {

/// Why a batch that need not be exact is.
enum class ExactReason {
  kNone,         ///< it is not
  kFewQueries,   ///< too few: sampling them would cost what it gains
  kFewPhotons,   ///< its queries find so few photons that merged ones cost as much here
  kErrorTooBig,  ///< no merged photons were found to keep within the error
  kNoMemory,     ///< there is none for fewer photons, or to measure what gathers cost
};

/// "", "few_queries", "few_photons", "error_too_big", "no_memory".
std::string_view NameOf(ExactReason reason);

/// What was chosen for a batch, and the error that was measured (core/error_sample.h).
struct MergeChoice {
  FewerPhotons fewer{};  ///< of no group size: exact, and `reason` says why
  MapOfFewer merged;     ///< the map of those, or none
  ExactReason reason = ExactReason::kNone;
  /// Where it is exact: subtrees are added up whole (GatherKind::kWhole), which costs less.
  bool whole = false;
  std::uint32_t sampled = 0;  ///< queries that were answered both ways
  float measured_error = 0;   ///< of the sample; where it is exact, of the last size that was tried
  float error_limit = 0;      ///< what the error of the batch is taken to be at most
  GatherTimes times;          ///< of the sample

  bool exact() const { return fewer.group_size == 0; }
};

/// Answers `queries` exactly, as `choice` says; where the device has no room to add up subtrees
/// whole, photon by photon, and so from then on. The errors of Gatherer::Gather.
absl::StatusOr<GatherResult> GatherExactly(const Gatherer& map, MergeChoice& choice,
                                           const GatherQueries& queries,
                                           const GatherOptions& options,
                                           const CancelCheck& cancelled = {});

/// The map of fewer photons; RESOURCE_EXHAUSTED where there is no memory for it.
using MergedMapOf = std::function<absl::StatusOr<MapOfFewer>(const FewerPhotons& fewer)>;

/// What gathers of a kind cost on the device; RESOURCE_EXHAUSTED where there is no memory to
/// measure it, or, for kWhole, for the moments that those need.
using CostsOf = std::function<absl::StatusOr<GatherCosts>(GatherKind kind)>;

/// Chooses how a batch is gathered whose options have Approximation::merges(). A sample of it, one
/// query in 32, at least 128 and more for small errors and for normals, is answered exactly and,
/// for max_relative_error, from the largest groups that an answer may be made of, then by ever
/// smaller ones, until the error is within and smaller ones would cost more. Within means: the mean
/// square, three standard errors of it, and what a sample of this size may have missed. What the
/// batch, the sample included, would cost each way is reckoned by `costs_of`, never timed: the same
/// batch gives the same choice as long as those stay. The errors of Gatherer::Gather, and of
/// `merged_map` and `costs_of` other than RESOURCE_EXHAUSTED.
absl::StatusOr<MergeChoice> ChooseMerge(const Gatherer& map, const MergedMapOf& merged_map,
                                        const CostsOf& costs_of, const GatherQueries& queries,
                                        const GatherOptions& options,
                                        const CancelCheck& cancelled = {});

}  // namespace treelight

#endif  // TREELIGHT_CORE_MERGE_CHOICE_H_
