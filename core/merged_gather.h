#ifndef TREELIGHT_CORE_MERGED_GATHER_H_
#define TREELIGHT_CORE_MERGED_GATHER_H_

#include <compare>
#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "core/gatherer.h"
#include "core/model/photons.h"

// Gathers from fewer photons that carry the light of all, on any device: merged ones
// (model/merge_photons.h), or a random subset (model/thin_photons.h).
namespace treelight {

/// What a map of fewer photons is made of.
struct FewerPhotons {
  enum class Kind {
    kMerged,   ///< up to group_size neighbours are merged to one
    kThinned,  ///< one of group_size stays
  };
  Kind kind = Kind::kMerged;
  std::uint32_t group_size = 0;
  friend auto operator<=>(const FewerPhotons&, const FewerPhotons&) = default;
};

/// A map of them.
struct MapOfFewer {
  std::shared_ptr<const Gatherer> map;
  double photon_power = 0;  ///< MeanPower of its photons
};

/// Such photons that an answer is made of, at least; a query that finds fewer is answered
/// exactly, which costs little there, and without which a few dark places would make most of the
/// error of a batch.
inline constexpr std::uint32_t kFewestMergedPhotons = 12;

/// Their light, in photons of MapOfFewer::photon_power, is as much as that of so many at least.
/// With less, few of those that are found face the query, or one that is far brighter than others
/// makes most of what there is, whose weight, near the rim, depends on the radius.
inline constexpr double kFewestMeanPhotons = 8;

/// What a photon carries where the light is: the mean over the photons, weighted by their power, of
/// the sum of its channels, W; 0 of no light. Of photons that are alike what each has; of a few
/// bright ones among many about what one of those has.
double MeanPower(const Photons& photons);

/// Photons that one photon of `merged` stands for, mean.
double GroupSize(const Gatherer& map, const Gatherer& merged);

/// The photons that k photons become, at least 1.
std::uint32_t MergedK(std::uint32_t k, double group_size);

/// What is gathered exactly for an answer that may be merged: with counts.
GatherOptions ExactOptions(const GatherOptions& options);

/// Answers `queries` from `merged`, a map of fewer photons of `map`: all within the radius where k
/// is 0, else as many as k photons become; counts are those of them times the photons that one
/// stands for. Queries that find fewer than kFewestMergedPhotons, or less light than that of
/// kFewestMeanPhotons, are answered exactly; GatherResult::merged says which are not. The errors of
/// Gatherer::Gather.
absl::StatusOr<GatherResult> GatherMerged(const Gatherer& map, const MapOfFewer& merged,
                                          const GatherQueries& queries,
                                          const GatherOptions& options,
                                          const CancelCheck& cancelled = {});

}  // namespace treelight

#endif  // TREELIGHT_CORE_MERGED_GATHER_H_
