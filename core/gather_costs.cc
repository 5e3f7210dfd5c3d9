#include "core/gather_costs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "core/cost_meter.h"

namespace treelight {
namespace {

/// Queries of a small batch, as samples are.
constexpr std::size_t kSmallBatch = 128;

GatherOptions Question(CostMeter& meter, const Gatherer& map, std::span<const float> positions,
                       GatherKind kind, std::uint32_t photons) {
  GatherOptions question{.outputs = kOutputCount | kOutputDensity};
  if (kind == GatherKind::kNearest) {
    question.k = photons;
  } else {
    question.radius = meter.RadiusOf(map, positions, photons);
    if (kind == GatherKind::kWhole) question.approximation.weight_tolerance = kWholeTolerance;
  }
  return question;
}

/// Of batches of two sizes, the fastest of each.
struct Times {
  double few_us = kNever;              // kSmallBatch queries
  double query_us = kNever, many = 0;  // a query of so many
};

Times Measured(CostMeter& meter, const Gatherer& map, std::span<const float> positions,
               const GatherOptions& question) {
  constexpr int kRounds = 2 * kMeasureRounds;
  const std::span<const float> few = positions.first(3 * kSmallBatch);
  meter.Gather(map, few, question);  // compiles, and computes moments
  const std::span<const float> many = meter.ForAWhile(map, positions, question);
  Times times{.many = static_cast<double>(many.size() / 3)};
  double many_us = kNever;
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 0; i < kMeasureRounds; ++i) meter.Gather(map, few, question, times.few_us);
    meter.Gather(map, many, question, many_us);
  }
  times.query_us = many_us / times.many;
  return times;
}

/// The line through both sizes, where a busy device does not make it too flat.
GatherCosts::Cost CostOf(const Times& times) {
  constexpr double kLeastPart = 0.3;  // of the larger batch that is its queries
  const double more_us = times.query_us * times.many - times.few_us;
  const double query_us =
      std::max(kLeastPart * times.query_us, more_us / (times.many - kSmallBatch));
  return {.batch_us = std::max(0.0, times.few_us - kSmallBatch * query_us), .query_us = query_us};
}

}  // namespace

GatherCosts::Cost GatherCosts::At(double photons) const {
  const double place = std::log2(photons / kFewest);
  if (!(place > 0)) return entries.front();
  constexpr std::size_t kLast = kEntries - 1;
  if (place >= kLast) {
    const Cost& last = entries.back();
    return {last.batch_us, last.query_us * std::exp2(place - kLast)};
  }
  const auto i = static_cast<std::size_t>(place);
  const double part = place - static_cast<double>(i);
  const auto between = [part](double a, double b) {
    return std::pow(a, 1 - part) * std::pow(b, part);
  };
  return {between(entries[i].batch_us, entries[i + 1].batch_us),
          between(entries[i].query_us, entries[i + 1].query_us)};
}

absl::StatusOr<GatherCosts> MeasureGatherCosts(Builder& builder, GatherKind kind,
                                               const CancelCheck& cancelled) {
  CostMeter meter(builder, cancelled);
  Photons photons = FacePhotons(kMeasuredPhotons);
  photons.powers.assign(photons.positions.size(), 1);
  double build_us = kNever;
  const auto map = meter.Build(photons, {}, build_us);
  std::array<Times, GatherCosts::kEntries> times;
  std::uint32_t found = GatherCosts::kFewest;
  for (Times& entry : times) {
    if (!meter.status().ok()) return meter.status();
    const GatherOptions question = Question(meter, *map, photons.positions, kind, found);
    entry = Measured(meter, *map, photons.positions, question);
    found *= 2;
  }
  if (!meter.status().ok()) return meter.status();
  // Fewer photons never take longer: where they seem to, something else has kept the device.
  GatherCosts costs;
  double few_us = kNever, query_us = kNever;
  for (std::size_t i = GatherCosts::kEntries; i-- > 0;) {
    times[i].few_us = few_us = std::min(few_us, times[i].few_us);
    costs.entries[i] = CostOf(times[i]);
    costs.entries[i].query_us = query_us = std::min(query_us, costs.entries[i].query_us);
  }
  return costs;
}

absl::StatusOr<GatherCosts> GatherCostsOfDevice::Find(GatherKind kind,
                                                      const CancelCheck& cancelled) {
  return costs_.Find(kind, [&] { return MeasureGatherCosts(builder_, kind, cancelled); });
}

std::uint64_t GatherCostsOfDevice::WorkBytes(GatherKind kind) const {
  return costs_.contains(kind) ? 0 : kMeasureBytes;
}

}  // namespace treelight
