#include "core/merge_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "core/merged_gather.h"
#include "core/model/split_mix.h"
#include "core/some_queries.h"

namespace treelight {
namespace {

// One query in so many is sampled, and at least so many where an error has to be kept.
constexpr std::size_t kSampledPart = 32, kFewestSamples = 128, kMostSamples = 4096;

// Standard errors of the mean square between what is measured and what is taken for granted.
constexpr double kMargin = 3;

// What is as rare as one query in a third of the sample is missing from it in one case of 20 (the
// rule of three): so many queries are taken to be there, with the largest error seen, at least
// this. Where normals leave photons out, few may be left of many, and rare errors are large.
constexpr double kMissedQueries = 3, kMissedError = 0.1, kMissedErrorOfNormals = 0.5;

double MissedError(const GatherQueries& queries) {
  return queries.normals.empty() ? kMissedError : kMissedErrorOfNormals;
}

// What it costs to find the place of a query, in photons that are compared there.
constexpr double kPlaceCost = 60;

/// `count` of `query_count` queries: one of each run of neighbours, which may be in the order of a
/// picture, at a place that is drawn.
std::vector<std::uint32_t> Sample(std::size_t query_count, std::size_t count) {
  std::vector<std::uint32_t> chosen(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t first = i * query_count / count, last = (i + 1) * query_count / count;
    chosen[i] = static_cast<std::uint32_t>(first + SplitMix(query_count + i) % (last - first));
  }
  return chosen;
}

double SumOfChannels(const GatherResult& answer, std::size_t query) {
  const float* const density = &answer.densities[3 * query];
  return double{density[0]} + density[1] + density[2];
}

/// MergeChoice tells what it is.
double SquaredError(double density, double exact) {
  if (density == exact) return 0;
  if (exact == 0) return 1;
  const double error = density / exact - 1;
  return std::isnan(error) ? std::numeric_limits<double>::infinity() : error * error;
}

struct SampledError {
  double measured = 0, limit = 0;  ///< root mean squares
};

SampledError ErrorOf(const GatherResult& answer, const GatherResult& exact, std::size_t count,
                     double missed_error) {
  double sum = 0, sum_of_squares = 0, largest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double square = SquaredError(SumOfChannels(answer, i), SumOfChannels(exact, i));
    sum += square;
    sum_of_squares += square * square;
    largest = std::max(largest, square);
  }
  const auto n = static_cast<double>(count);
  const double mean = sum / n;
  const double variance = std::max(0.0, sum_of_squares / n - mean * mean) / std::max(1.0, n - 1);
  const double missed = kMissedQueries * std::max(largest, missed_error * missed_error) / n;
  return {std::sqrt(mean), std::sqrt(mean + kMargin * std::sqrt(variance) + missed)};
}

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

/// One choice. Costs are of a query, mean, in photons that are compared.
class Chooser {
 public:
  Chooser(const Gatherer& map, const GatherQueries& queries, const GatherOptions& options,
          const CancelCheck& cancelled)
      : map_(map),
        queries_(queries),
        options_(options),
        cancelled_(cancelled),
        keeps_error_(options.approximation.max_relative_error > 0),
        count_(SampleSize(queries, options.approximation.max_relative_error)),
        sample_(queries, Sample(queries.size(), count_)) {}

  absl::StatusOr<MergeChoice> Run(const MergedMapOf& merged_map) {
    if (auto status = CountPhotons(); !status.ok()) return status;
    if (keeps_error_ && !MayGain()) return choice_;
    auto exact = map_.Gather(sample_.view(), ExactOptions(options_), cancelled_);
    if (!exact.ok()) return exact.status();
    exact_ = *std::move(exact);
    choice_.times += exact_.times;
    photons_ = Mean(exact_.counts);
    choice_.reason = ExactReason::kFewPhotons;
    spent_ = ExactCost();
    for (const FewerPhotons& fewer : Candidates(options_.approximation)) {
      const std::uint32_t size = fewer.group_size;
      // Groups are more than half full.
      if (photons_ < double{kFewestMergedPhotons} * size / 2) continue;
      if (!choice_.exact() && PlaceCost(2 * photons_ / size) >= cost_) break;
      const auto merged = merged_map(fewer);
      if (absl::IsResourceExhausted(merged.status())) {
        if (choice_.exact()) choice_.reason = ExactReason::kNoMemory;
        break;
      }
      if (!merged.ok()) return merged.status();
      if (auto status = Try(fewer, *merged); !status.ok()) return status;
    }
    return choice_;
  }

 private:
  /// So many that what they may have missed takes half of the error, at most.
  static std::size_t SampleSize(const GatherQueries& queries, double error) {
    const std::size_t part = (queries.size() + kSampledPart - 1) / kSampledPart;
    const std::size_t count = std::min(part, kMostSamples);
    if (error == 0) return count;
    const double missed = MissedError(queries) / error;
    const double needed = std::max(2 * kMissedQueries * missed * missed, double{kFewestSamples});
    const auto all = static_cast<double>(queries.size());
    return std::max(count, static_cast<std::size_t>(std::min(std::ceil(needed), all)));
  }

  static double PlaceCost(double photons) { return kPlaceCost + photons; }
  double ExactCost() const { return PlaceCost(photons_); }

  /// How many photons the queries find: k at most, or by their number alone, which is cheap.
  absl::Status CountPhotons() {
    photons_ = options_.k;
    if (!keeps_error_ || options_.k > 0) return absl::OkStatus();
    GatherOptions counts = ExactOptions(options_);
    counts.outputs = kOutputCount;
    const auto counted =
        map_.Gather({.positions = sample_.positions, .radii = sample_.radii}, counts, cancelled_);
    if (!counted.ok()) return counted.status();
    choice_.times += counted->times;
    photons_ = Mean(counted->counts);
    return absl::OkStatus();
  }

  /// Whether the fewest photons that an answer may be made of gain at least twice what the sample
  /// costs, which is answered in two ways.
  bool MayGain() {
    const double gained = ExactCost() - PlaceCost(kFewestMergedPhotons);
    const auto all = static_cast<double>(queries_.size()), sampled = static_cast<double>(count_);
    choice_.reason =
        photons_ < 2 * kFewestMergedPhotons ? ExactReason::kFewPhotons : ExactReason::kFewQueries;
    return choice_.reason == ExactReason::kFewQueries &&
           all * gained > 2 * 2 * sampled * ExactCost();
  }

  /// Answers the sample from `merged`, and takes its group size where that is good and cheaper.
  absl::Status Try(const FewerPhotons& fewer, std::shared_ptr<const Gatherer> merged) {
    const double group_size = GroupSize(map_, *merged);
    if (options_.k > 0 && MergedK(options_.k, group_size) < kFewestMergedPhotons) {
      return absl::OkStatus();
    }
    const auto answer = GatherMerged(map_, *merged, sample_.view(), options_, cancelled_);
    if (!answer.ok()) return answer.status();
    choice_.times += answer->times;
    const SampledError error = ErrorOf(*answer, exact_, count_, MissedError(queries_));
    const double cost = PlaceCost(photons_ / group_size) + ExactCost() * (1 - Mean(answer->merged));
    spent_ += cost;
    const bool is_within =
        !keeps_error_ || error.limit <= options_.approximation.max_relative_error;
    const bool is_cheaper = !keeps_error_ || IsCheaper(cost);
    if (!choice_.exact() && !(is_within && is_cheaper)) return absl::OkStatus();
    choice_.sampled = static_cast<std::uint32_t>(count_);
    choice_.measured_error = static_cast<float>(error.measured);
    choice_.error_limit = static_cast<float>(error.limit);
    if (is_within && is_cheaper) {
      choice_.fewer = fewer;
      choice_.merged = std::move(merged);
      choice_.reason = ExactReason::kNone;
      cost_ = cost;
    } else {
      choice_.reason = is_within ? ExactReason::kFewPhotons : ExactReason::kErrorTooBig;
    }
    return absl::OkStatus();
  }

  /// Than the best so far, or than all exact, where what the sample cost is gained back.
  bool IsCheaper(double cost) const {
    if (!choice_.exact()) return cost < cost_;
    const auto all = static_cast<double>(queries_.size()), sampled = static_cast<double>(count_);
    return all * cost + sampled * spent_ < all * ExactCost();
  }

  const Gatherer& map_;
  const GatherQueries& queries_;
  const GatherOptions& options_;
  const CancelCheck& cancelled_;
  const bool keeps_error_;
  const std::size_t count_;  // queries of the sample
  const SomeQueries sample_;
  GatherResult exact_;
  double photons_ = 0;  // that a query finds, mean
  double spent_ = 0;    // on each query of the sample
  double cost_ = 0;     // of choice_
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

absl::StatusOr<MergeChoice> ChooseMerge(const Gatherer& map, const MergedMapOf& merged_map,
                                        const GatherQueries& queries, const GatherOptions& options,
                                        const CancelCheck& cancelled) {
  return Chooser(map, queries, options, cancelled).Run(merged_map);
}

}  // namespace treelight
