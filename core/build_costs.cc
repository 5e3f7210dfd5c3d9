#include "core/build_costs.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "core/cost_meter.h"

namespace treelight {
namespace {

constexpr std::size_t kFewPhotons = 1 << 14;

BuildOptions OptionsOf(const TreeCandidate& candidate) {
  return {.builder = candidate.builder,
          .max_leaf_size = candidate.max_leaf_size,
          .subtree_size = kCandidateSubtree};
}

/// Times of builds of a set by each candidate, and its last map where `maps` is given.
std::vector<double> TimeBuilds(CostMeter& meter, const Photons& photons,
                               std::vector<std::unique_ptr<Gatherer>>* maps = nullptr) {
  std::vector<double> fastest_us(kTreeCandidates.size(), kNever);
  if (maps != nullptr) maps->resize(kTreeCandidates.size());
  for (int round = 0; round < kMeasureRounds; ++round) {
    for (std::size_t i = 0; i < kTreeCandidates.size(); ++i) {
      auto map = meter.Build(photons, OptionsOf(kTreeCandidates[i]), fastest_us[i]);
      if (maps != nullptr) (*maps)[i] = std::move(map);
    }
  }
  return fastest_us;
}

/// What to ask: the `k` nearest, or all within a radius that holds 50 at the median.
GatherOptions Question(CostMeter& meter, const Gatherer& map, std::span<const float> positions,
                       std::uint32_t k) {
  GatherOptions question{.k = k, .outputs = kOutputCount | kOutputRadius};
  if (k == 0) question.radius = meter.RadiusOf(map, positions, 50);
  return question;
}

/// Microseconds of a gather in each of `maps`, in batches that take a while.
std::vector<double> TimeGathers(CostMeter& meter,
                                const std::vector<std::unique_ptr<Gatherer>>& maps,
                                const Photons& photons, std::uint32_t k) {
  const GatherOptions question = Question(meter, *maps.front(), photons.positions, k);
  const std::span<const float> positions =
      meter.ForAWhile(*maps.front(), photons.positions, question);
  std::vector<double> fastest_us(maps.size(), kNever);
  for (int round = 0; round < 2 * kMeasureRounds; ++round) {
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const auto times = meter.Gather(*maps[i], positions, question).times;
      fastest_us[i] = std::min(fastest_us[i], times.kernel_us);
    }
  }
  for (double& us : fastest_us) us /= static_cast<double>(positions.size() / 3);
  return fastest_us;
}

/// Sets what codes of 63 bits and shared cells cost, by builds that take turns: neither saves time.
void MeasureCodes(CostMeter& meter, const Photons& spread, BuildCosts& costs) {
  // All but one in a cell of 30 bits: 10 to an axis number 1024.
  const Photons together = FacePhotons(spread.size(), 4096);
  const BuildOptions usual = OptionsOf(kTreeCandidates.front());
  BuildOptions with_long_codes = usual;
  with_long_codes.morton_bits = MortonBits::k63;
  double usual_us = kNever, long_us = kNever, together_us = kNever;
  for (int round = 0; round < kMeasureRounds; ++round) {
    meter.Build(spread, usual, usual_us);
    meter.Build(spread, with_long_codes, long_us);
    meter.Build(together, usual, together_us);
  }
  const auto excess = [&](double us) {
    return std::max(0.0, us - usual_us) / static_cast<double>(spread.size());
  };
  costs.long_code_us = excess(long_us);
  costs.shared_cell_us = excess(together_us);
}

}  // namespace

absl::StatusOr<BuildCosts> MeasureBuildCosts(Builder& builder, std::uint32_t k,
                                             const CancelCheck& cancelled) {
  CostMeter meter(builder, cancelled);
  const Photons few = FacePhotons(kFewPhotons), many = FacePhotons(kMeasuredPhotons);
  std::vector<std::unique_ptr<Gatherer>> maps;
  const std::vector<double> few_us = TimeBuilds(meter, few);
  const std::vector<double> many_us = TimeBuilds(meter, many, &maps);
  if (!meter.status().ok()) return meter.status();
  const std::vector<double> gather_us = TimeGathers(meter, maps, many, k);
  BuildCosts costs;
  for (std::size_t i = 0; i < costs.trees.size(); ++i) {
    const double photon_us =
        std::max(0.0, many_us[i] - few_us[i]) / static_cast<double>(kMeasuredPhotons - kFewPhotons);
    costs.trees[i] = {.build_us = std::max(0.0, few_us[i] - photon_us * kFewPhotons),
                      .photon_us = photon_us,
                      .gather_us = gather_us[i]};
  }
  MeasureCodes(meter, many, costs);
  if (!meter.status().ok()) return meter.status();
  return costs;
}

}  // namespace treelight
