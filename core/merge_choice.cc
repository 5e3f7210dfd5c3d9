#include "core/merge_choice.h"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "core/error_sample.h"
#include "core/merged_gather.h"
#include "core/some_queries.h"

namespace treelight {
namespace {

// A batch has at least so many times the queries of its sample, which is answered in two ways.
constexpr std::size_t kFewestTimesSample = 4;

/// What may be chosen, in the order in which it is tried.
std::vector<FewerPhotons> Candidates(const Approximation& approximation) {
  using enum FewerPhotons::Kind;
  if (approximation.thinned_photons > 0) return {{kThinned, approximation.thinned_photons}};
  if (approximation.merged_photons > 0) return {{kMerged, approximation.merged_photons}};
  std::vector<FewerPhotons> candidates;
  for (std::uint32_t size = kMaxMergedPhotons; size > 1; size /= 2) {
    candidates.push_back({kMerged, size});
  }
  return candidates;
}

template <typename T>
double Mean(const std::vector<T>& numbers) {
  return std::accumulate(numbers.begin(), numbers.end(), 0.0) / static_cast<double>(numbers.size());
}

/// One choice. Costs are of a whole batch, microseconds.
class Chooser {
 public:
  Chooser(const Gatherer& map, const CostsOf& costs_of, const GatherQueries& queries,
          const GatherOptions& options, const CancelCheck& cancelled)
      : map_(map),
        costs_of_(costs_of),
        queries_(queries),
        options_(options),
        cancelled_(cancelled),
        keeps_error_(options.approximation.max_relative_error > 0),
        count_(SampleSize(queries, options.approximation.max_relative_error)),
        sample_(queries, SampledQueries(queries.size(), count_)) {}

  absl::StatusOr<MergeChoice> Run(const MergedMapOf& merged_map) {
    if (keeps_error_) {
      const auto may_gain = MayGain();
      if (!may_gain.ok()) return may_gain.status();
      if (!*may_gain) return choice_;
    }
    if (auto status = AnswerExactly(); !status.ok()) return status;
    choice_.reason = ExactReason::kFewPhotons;
    for (const FewerPhotons& fewer : Candidates(options_.approximation)) {
      const std::uint32_t size = fewer.group_size;
      // Groups are more than half full.
      if (photons_ < double{kFewestMergedPhotons} * size / 2) continue;
      if (!choice_.exact() && MergedCost(2 * photons_ / size, 1, all()) >= cost_us_) break;
      const auto merged = merged_map(fewer);
      if (absl::IsResourceExhausted(merged.status())) {
        if (choice_.exact()) choice_.reason = ExactReason::kNoMemory;
        break;
      }
      if (!merged.ok()) return merged.status();
      if (auto status = Try(fewer, *merged); !status.ok()) return status;
    }
    if (!choice_.exact()) choice_.whole = false;
    return choice_;
  }

 private:
  double all() const { return static_cast<double>(queries_.size()); }
  double sampled() const { return static_cast<double>(count_); }
  double ExactCost(double queries) const {
    return (choice_.whole ? whole_costs_ : costs_).At(photons_).Of(queries);
  }

  /// Of `queries` that find so many merged photons, but for a part that is answered exactly.
  double MergedCost(double merged_photons, double merged_part, double queries) const {
    const double cost_us = costs_.At(merged_photons).Of(queries);
    if (merged_part == 1) return cost_us;
    return cost_us + costs_.At(photons_).Of(queries * (1 - merged_part));
  }

  /// Whether subtrees added up whole are the cheapest way of answering the batch exactly, where
  /// queries find so many photons.
  bool IsCheaperWhole(double photons) const {
    return may_be_whole_ && whole_costs_.At(photons).Of(all()) < costs_.At(photons).Of(all());
  }
  GatherCosts::Cost CheapestExact(double photons) const {
    return (IsCheaperWhole(photons) ? whole_costs_ : costs_).At(photons);
  }

  /// What the fewest photons that an answer may be made of gain.
  double Gain(double photons) const {
    return CheapestExact(photons).Of(all()) - MergedCost(kFewestMergedPhotons, 1, all());
  }

  /// Whether that is at least twice what the sample costs, which is answered in two ways.
  bool Pays(double photons) const {
    return Gain(photons) > 2 * 2 * CheapestExact(photons).Of(sampled());
  }

  /// Whether fewer photons may pay; else the choice has the reason.
  absl::StatusOr<bool> MayGain() {
    choice_.reason = ExactReason::kFewQueries;
    if (queries_.size() <= kFewestTimesSample * count_) return false;
    photons_ = options_.k;
    choice_.reason = ExactReason::kFewPhotons;
    if (options_.k > 0 && photons_ < 2 * kFewestMergedPhotons) return false;
    if (auto status = FindCosts(); absl::IsResourceExhausted(status)) {
      choice_.reason = ExactReason::kNoMemory;
      return false;
    } else if (!status.ok()) {
      return status;
    }
    if (options_.k == 0) {
      if (!PaysForSome()) return false;
      if (auto status = CountPhotons(); !status.ok()) return status;
      choice_.whole = IsCheaperWhole(photons_);
      choice_.reason = ExactReason::kFewPhotons;
      if (photons_ < 2 * kFewestMergedPhotons) return false;
    }
    if (Gain(photons_) <= 0) return false;
    choice_.reason = ExactReason::kFewQueries;
    return Pays(photons_);
  }

  /// Whether there is a number of photons, of those that were measured, for which fewer may pay.
  /// Where there is none the photons are not even counted, which takes as long as a small batch:
  /// the exact way is the one that costs less over all these numbers.
  bool PaysForSome() {
    choice_.reason = ExactReason::kFewPhotons;
    double each_us = 0, whole_us = 0, photons = GatherCosts::kFewest;
    for (std::size_t i = 0; i < GatherCosts::kEntries; ++i, photons *= 2) {
      if (Pays(photons)) return true;
      if (Gain(photons) > 0) choice_.reason = ExactReason::kFewQueries;
      each_us += costs_.At(photons).Of(all());
      whole_us += whole_costs_.At(photons).Of(all());
    }
    choice_.whole = may_be_whole_ && whole_us < each_us;
    return false;
  }

  /// How many photons the queries find within the radius.
  absl::Status CountPhotons() {
    GatherOptions counts = ExactOptions(options_);
    counts.outputs = kOutputCount;
    const auto counted =
        map_.Gather({.positions = sample_.positions, .radii = sample_.radii}, counts, cancelled_);
    if (!counted.ok()) return counted.status();
    choice_.times += counted->times;
    photons_ = Mean(counted->counts);
    return absl::OkStatus();
  }

  absl::Status FindCosts() {
    const auto costs = costs_of_(options_.k > 0 ? GatherKind::kNearest : GatherKind::kWithin);
    if (!costs.ok()) return costs.status();
    costs_ = *costs;
    // Normals leave out photons, and moments know of none; the cone's sums are not exact.
    if (options_.k > 0 || !queries_.normals.empty() || !map_.has_powers() ||
        options_.kernel == DensityKernel::kCone) {
      return absl::OkStatus();
    }
    const auto whole = costs_of_(GatherKind::kWhole);
    if (absl::IsResourceExhausted(whole.status())) return absl::OkStatus();  // it is no choice
    if (!whole.ok()) return whole.status();
    whole_costs_ = *whole;
    may_be_whole_ = true;
    return absl::OkStatus();
  }

  absl::Status AnswerExactly() {
    auto exact = GatherExactly(map_, choice_, sample_.view(), ExactOptions(options_), cancelled_);
    if (!exact.ok()) return exact.status();
    exact_ = *std::move(exact);
    choice_.times += exact_.times;
    photons_ = Mean(exact_.counts);
    spent_us_ = ExactCost(sampled());
    return absl::OkStatus();
  }

  /// Answers the sample from `merged`, and takes its group size where that is good and cheaper.
  absl::Status Try(const FewerPhotons& fewer, MapOfFewer merged) {
    const double group_size = GroupSize(map_, *merged.map);
    if (options_.k > 0 && MergedK(options_.k, group_size) < kFewestMergedPhotons) {
      return absl::OkStatus();
    }
    const auto answer = GatherMerged(map_, merged, sample_.view(), options_, cancelled_);
    if (!answer.ok()) return answer.status();
    choice_.times += answer->times;
    const SampledError error = ErrorOf(*answer, exact_, sample_.view());
    const double part = Mean(answer->merged),
                 cost_us = MergedCost(photons_ / group_size, part, all());
    spent_us_ += MergedCost(photons_ / group_size, part, sampled());
    const bool is_within =
        !keeps_error_ || error.limit <= options_.approximation.max_relative_error;
    const bool is_cheaper = !keeps_error_ || IsCheaper(cost_us);
    if (!choice_.exact() && !(is_within && is_cheaper)) return absl::OkStatus();
    choice_.sampled = static_cast<std::uint32_t>(count_);
    choice_.measured_error = static_cast<float>(error.measured);
    choice_.error_limit = static_cast<float>(error.limit);
    if (is_within && is_cheaper) {
      choice_.fewer = fewer;
      choice_.merged = std::move(merged);
      choice_.reason = ExactReason::kNone;
      cost_us_ = cost_us;
    } else {
      choice_.reason = is_within ? ExactReason::kFewPhotons : ExactReason::kErrorTooBig;
    }
    return absl::OkStatus();
  }

  /// Than the best so far, or than all exact, where what the sample cost is gained back.
  bool IsCheaper(double cost_us) const {
    return choice_.exact() ? cost_us + spent_us_ < ExactCost(all()) : cost_us < cost_us_;
  }

  const Gatherer& map_;
  const CostsOf& costs_of_;
  const GatherQueries& queries_;
  const GatherOptions& options_;
  const CancelCheck& cancelled_;
  const bool keeps_error_;
  const std::size_t count_;  // queries of the sample
  const SomeQueries sample_;
  GatherCosts costs_, whole_costs_;  // photon by photon, and by whole subtrees; to keep an error
  bool may_be_whole_ = false;
  GatherResult exact_;
  double photons_ = 0;   // that a query finds, mean
  double spent_us_ = 0;  // on the sample
  double cost_us_ = 0;   // of choice_
  MergeChoice choice_;
};

}  // namespace

std::string_view NameOf(ExactReason reason) {
  switch (reason) {
    case ExactReason::kNone:
      return "";
    case ExactReason::kFewQueries:
      return "few_queries";
    case ExactReason::kFewPhotons:
      return "few_photons";
    case ExactReason::kErrorTooBig:
      return "error_too_big";
    case ExactReason::kNoMemory:
      return "no_memory";
  }
  return "unknown";
}

absl::StatusOr<GatherResult> GatherExactly(const Gatherer& map, MergeChoice& choice,
                                           const GatherQueries& queries,
                                           const GatherOptions& options,
                                           const CancelCheck& cancelled) {
  GatherOptions exact = options;
  exact.approximation = {};
  if (choice.whole) {
    exact.approximation.weight_tolerance = kWholeTolerance;
    auto result = map.Gather(queries, exact, cancelled);
    if (!absl::IsResourceExhausted(result.status())) return result;
    choice.whole = false;
    exact.approximation = {};
  }
  return map.Gather(queries, exact, cancelled);
}

absl::StatusOr<MergeChoice> ChooseMerge(const Gatherer& map, const MergedMapOf& merged_map,
                                        const CostsOf& costs_of, const GatherQueries& queries,
                                        const GatherOptions& options,
                                        const CancelCheck& cancelled) {
  return Chooser(map, costs_of, queries, options, cancelled).Run(merged_map);
}

}  // namespace treelight
