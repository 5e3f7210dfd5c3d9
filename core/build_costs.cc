#include "core/build_costs.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <utility>
#include <vector>

namespace treelight {
namespace {

constexpr std::size_t kFewPhotons = 1 << 14, kManyPhotons = 1 << 17;
constexpr int kRounds = 3;  // the fastest counts: whatever else the machine does only adds time

/// Points on the faces of the unit cube, the first of them moved to (outlier, outlier, outlier).
/// Leaves of a grid are filled more or less by how many photons a cell has, the same again with
/// four times as many on a surface: the faces' densities, from 1 to 3.2, span that.
Photons FacePhotons(std::size_t count, float outlier = 1) {
  std::mt19937 engine(1);
  const auto uniform = [&engine] { return static_cast<float>(engine() >> 8) * 0x1p-24f; };
  std::discrete_distribution choose_face{1, 1.26, 1.59, 2, 2.52, 3.17};
  Photons photons;
  photons.positions.resize(3 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto face = static_cast<std::uint32_t>(choose_face(engine));
    for (std::uint32_t axis = 0; axis < 3; ++axis) photons.positions[3 * i + axis] = uniform();
    photons.positions[3 * i + face / 2] = static_cast<float>(face % 2);
  }
  std::fill_n(photons.positions.begin(), 3, outlier);
  return photons;
}

BuildOptions OptionsOf(const TreeCandidate& candidate) {
  return {.builder = candidate.builder,
          .max_leaf_size = candidate.max_leaf_size,
          .subtree_size = kCandidateSubtree};
}

/// Builds and gathers on one device, their times, and the first error.
class Meter {
 public:
  Meter(Builder& builder, const CancelCheck& cancelled)
      : builder_(builder), cancelled_(cancelled) {}

  /// Builds a map; null after an error. The wall time in microseconds is the least of what
  /// `fastest_us` was and this one.
  std::unique_ptr<Gatherer> Build(const Photons& photons, const BuildOptions& options,
                                  double& fastest_us) {
    if (!status_.ok()) return nullptr;
    const auto begun = std::chrono::steady_clock::now();
    auto map = builder_.Build(photons, options, cancelled_);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begun;
    status_ = map.status();
    if (!map.ok()) return nullptr;
    fastest_us = std::min(fastest_us, took.count());
    return *std::move(map);
  }

  /// Gathers; an empty answer after an error.
  GatherResult Gather(const Gatherer& map, std::span<const float> positions,
                      const GatherOptions& options) {
    if (!status_.ok()) return {};
    auto result = map.Gather({.positions = positions}, options, cancelled_);
    status_ = result.status();
    return result.ok() ? *std::move(result) : GatherResult{};
  }

  const absl::Status& status() const { return status_; }

 private:
  Builder& builder_;
  const CancelCheck& cancelled_;
  absl::Status status_;
};

constexpr double kNever = std::numeric_limits<double>::infinity();

/// Times of builds of a set by each candidate, and its last map where `maps` is given.
std::vector<double> TimeBuilds(Meter& meter, const Photons& photons,
                               std::vector<std::unique_ptr<Gatherer>>* maps = nullptr) {
  std::vector<double> fastest_us(kTreeCandidates.size(), kNever);
  if (maps != nullptr) maps->resize(kTreeCandidates.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < kTreeCandidates.size(); ++i) {
      auto map = meter.Build(photons, OptionsOf(kTreeCandidates[i]), fastest_us[i]);
      if (maps != nullptr) (*maps)[i] = std::move(map);
    }
  }
  return fastest_us;
}

/// What to ask: the `k` nearest, or all within a radius that holds 50 at the median.
GatherOptions Question(Meter& meter, const Gatherer& map, std::span<const float> positions,
                       std::uint32_t k) {
  constexpr std::uint32_t kOutputs = kOutputCount | kOutputRadius;
  if (k > 0) return {.k = k, .outputs = kOutputs};
  const GatherOptions nearest{.k = 50, .outputs = kOutputRadius};
  std::vector<float> radii = meter.Gather(map, positions.first(3 * 1024), nearest).radii;
  if (radii.empty()) return {};
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  return {.k = 0, .radius = *middle, .outputs = kOutputs};
}

/// Microseconds of a gather in each of `maps`, in batches that take a while.
std::vector<double> TimeGathers(Meter& meter, const std::vector<std::unique_ptr<Gatherer>>& maps,
                                const Photons& photons, std::uint32_t k) {
  constexpr std::chrono::milliseconds kWhile{2};
  const std::span<const float> positions = photons.positions;  // in random order
  const GatherOptions question = Question(meter, *maps.front(), positions, k);
  std::size_t count = 512;
  bool while_reached = false;
  while (count < kManyPhotons && !while_reached && meter.status().ok()) {
    count *= 2;
    const auto begun = std::chrono::steady_clock::now();
    meter.Gather(*maps.front(), positions.first(3 * count), question);
    while_reached = std::chrono::steady_clock::now() - begun >= kWhile;
  }
  std::vector<double> fastest_us(maps.size(), kNever);
  for (int round = 0; round < 2 * kRounds; ++round) {
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const auto times = meter.Gather(*maps[i], positions.first(3 * count), question).times;
      fastest_us[i] = std::min(fastest_us[i], times.kernel_us);
    }
  }
  for (double& us : fastest_us) us /= static_cast<double>(count);
  return fastest_us;
}

/// Sets what codes of 63 bits and shared cells cost, by builds that take turns: neither saves time.
void MeasureCodes(Meter& meter, const Photons& spread, BuildCosts& costs) {
  // All but one in a cell of 30 bits: 10 to an axis number 1024.
  const Photons together = FacePhotons(spread.size(), 4096);
  const BuildOptions usual = OptionsOf(kTreeCandidates.front());
  BuildOptions with_long_codes = usual;
  with_long_codes.morton_bits = MortonBits::k63;
  double usual_us = kNever, long_us = kNever, together_us = kNever;
  for (int round = 0; round < kRounds; ++round) {
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
  Meter meter(builder, cancelled);
  const Photons few = FacePhotons(kFewPhotons), many = FacePhotons(kManyPhotons);
  std::vector<std::unique_ptr<Gatherer>> maps;
  const std::vector<double> few_us = TimeBuilds(meter, few);
  const std::vector<double> many_us = TimeBuilds(meter, many, &maps);
  if (!meter.status().ok()) return meter.status();
  const std::vector<double> gather_us = TimeGathers(meter, maps, many, k);
  BuildCosts costs;
  for (std::size_t i = 0; i < costs.trees.size(); ++i) {
    const double photon_us =
        std::max(0.0, many_us[i] - few_us[i]) / static_cast<double>(kManyPhotons - kFewPhotons);
    costs.trees[i] = {.build_us = std::max(0.0, few_us[i] - photon_us * kFewPhotons),
                      .photon_us = photon_us,
                      .gather_us = gather_us[i]};
  }
  MeasureCodes(meter, many, costs);
  if (!meter.status().ok()) return meter.status();
  return costs;
}

}  // namespace treelight
