#include "core/cost_meter.h"

#include <algorithm>
#include <chrono>
#include <random>
#include <utility>
#include <vector>

namespace treelight {
namespace {

/// Runs `work`; the least of its wall time and what `fastest_us` was.
template <typename Work>
auto Timed(Work work, double& fastest_us) {
  const auto begun = std::chrono::steady_clock::now();
  auto result = work();
  const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begun;
  fastest_us = std::min(fastest_us, took.count());
  return result;
}

}  // namespace

Photons FacePhotons(std::size_t count, float outlier) {
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

std::unique_ptr<Gatherer> CostMeter::Build(const Photons& photons, const BuildOptions& options,
                                           double& fastest_us) {
  if (!status_.ok()) return nullptr;
  auto map = Timed([&] { return builder_.Build(photons, options, cancelled_); }, fastest_us);
  status_ = map.status();
  return map.ok() ? *std::move(map) : nullptr;
}

GatherResult CostMeter::Gather(const Gatherer& map, std::span<const float> positions,
                               const GatherOptions& options) {
  double any_us = kNever;
  return Gather(map, positions, options, any_us);
}

GatherResult CostMeter::Gather(const Gatherer& map, std::span<const float> positions,
                               const GatherOptions& options, double& fastest_us) {
  if (!status_.ok()) return {};
  auto result =
      Timed([&] { return map.Gather({.positions = positions}, options, cancelled_); }, fastest_us);
  status_ = result.status();
  return result.ok() ? *std::move(result) : GatherResult{};
}

std::span<const float> CostMeter::ForAWhile(const Gatherer& map, std::span<const float> positions,
                                            const GatherOptions& options) {
  constexpr double kWhileUs = 2000;
  const std::size_t all = positions.size() / 3;
  std::size_t count = 512;
  bool while_reached = false;
  while (count < all && !while_reached && status_.ok()) {
    count *= 2;
    double took_us = kNever;  // the second time counts: the first may be slow for other reasons
    for (int i = 0; i < 2; ++i) {
      Gather(map, positions.first(3 * std::min(count, all)), options, took_us);
    }
    while_reached = took_us >= kWhileUs;
  }
  return positions.first(3 * std::min(count, all));
}

float CostMeter::RadiusOf(const Gatherer& map, std::span<const float> positions,
                          std::uint32_t count) {
  const std::span<const float> some =
      positions.first(std::min<std::size_t>(positions.size(), 3072));
  std::vector<float> radii = Gather(map, some, {.k = count, .outputs = kOutputRadius}).radii;
  if (radii.empty()) return 0;
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  return *middle;
}

}  // namespace treelight
