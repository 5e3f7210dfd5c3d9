#include "core/merged_gather.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/some_queries.h"

namespace treelight {
namespace {

double Magnitude(const float* channels) {
  return std::fabs(double{channels[0]}) + std::fabs(double{channels[1]}) +
         std::fabs(double{channels[2]});
}

/// The light that query `i` found, W: photons weigh 1 in the mean, whatever the kernel.
double LightOf(const GatherResult& result, std::size_t i) {
  const double radius = result.radii[i];
  return Magnitude(&result.densities[3 * i]) * std::numbers::pi * radius * radius;
}

/// Answers those queries exactly that are not to be answered by merged photons.
absl::Status AnswerExactly(const Gatherer& map, const GatherQueries& queries,
                           const GatherOptions& options, const CancelCheck& cancelled,
                           GatherResult& result) {
  std::vector<std::uint32_t> few;
  for (std::uint32_t i = 0; i < result.merged.size(); ++i) {
    if (result.merged[i] == 0) few.push_back(i);
  }
  if (few.empty()) return absl::OkStatus();
  const SomeQueries some(queries, few);
  const auto exact = map.Gather(some.view(), ExactOptions(options), cancelled);
  if (!exact.ok()) return exact.status();
  for (std::size_t i = 0; i < few.size(); ++i) {
    result.counts[few[i]] = exact->counts[i];
    if (!exact->radii.empty()) result.radii[few[i]] = exact->radii[i];
    std::copy_n(&exact->densities[3 * i], 3, &result.densities[3 * std::size_t{few[i]}]);
  }
  result.times += exact->times;
  return absl::OkStatus();
}

}  // namespace

double GroupSize(const Gatherer& map, const Gatherer& merged) {
  return static_cast<double>(map.photon_count()) / static_cast<double>(merged.photon_count());
}

std::uint32_t MergedK(std::uint32_t k, double group_size) {
  return std::max(1u, static_cast<std::uint32_t>(k / group_size + 0.5));
}

GatherOptions ExactOptions(const GatherOptions& options) {
  GatherOptions exact = options;
  exact.approximation = {};
  exact.outputs |= kOutputCount;
  return exact;
}

double MeanPower(const Photons& photons) {
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < photons.powers.size(); i += 3) {
    const double power = Magnitude(&photons.powers[i]);
    sum += power;
    squares += power * power;
  }
  return sum > 0 ? squares / sum : 0;
}

absl::StatusOr<GatherResult> GatherMerged(const Gatherer& map, const MapOfFewer& merged,
                                          const GatherQueries& queries,
                                          const GatherOptions& options,
                                          const CancelCheck& cancelled) {
  const double group_size = GroupSize(map, *merged.map);
  const double least_light = kFewestMeanPhotons * merged.photon_power;
  GatherOptions from_merged = ExactOptions(options);
  from_merged.outputs |= kOutputRadius | kOutputDensity;
  if (options.k > 0) from_merged.k = MergedK(options.k, group_size);
  auto result = merged.map->Gather(queries, from_merged, cancelled);
  if (!result.ok()) return result;
  result->merged.resize(queries.size());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    std::uint32_t& count = result->counts[i];
    result->merged[i] = count >= kFewestMergedPhotons && LightOf(*result, i) >= least_light ? 1 : 0;
    const bool all = options.k > 0 && count == from_merged.k;
    const auto photons = static_cast<std::uint32_t>(std::lround(count * group_size));
    count = all ? options.k : options.k > 0 ? std::min(options.k, photons) : photons;
  }
  auto status = AnswerExactly(map, queries, options, cancelled, *result);
  if (!status.ok()) return status;
  if ((options.outputs & kOutputCount) == 0) result->counts.clear();
  if ((options.outputs & kOutputRadius) == 0) result->radii.clear();
  return result;
}

}  // namespace treelight
