#include "core/gather_costs.h"

#include <algorithm>
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

/// By batches of two sizes, which take turns.
GatherCosts::Cost CostOf(CostMeter& meter, const Gatherer& map, std::span<const float> positions,
                         const GatherOptions& question) {
  const std::span<const float> few = positions.first(3 * kSmallBatch);
  meter.Gather(map, few, question);  // compiles, and computes moments
  const std::span<const float> many = meter.ForAWhile(map, positions, question);
  double few_us = kNever, many_us = kNever;
  for (int round = 0; round < kMeasureRounds; ++round) {
    for (int i = 0; i < kMeasureRounds; ++i) meter.Gather(map, few, question, few_us);
    meter.Gather(map, many, question, many_us);
  }
  const auto more = static_cast<double>((many.size() - few.size()) / 3);
  const double query_us = std::max(0.0, many_us - few_us) / more;
  return {.batch_us = std::max(0.0, few_us - kSmallBatch * query_us), .query_us = query_us};
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
  GatherCosts costs;
  std::uint32_t found = GatherCosts::kFewest;
  for (GatherCosts::Cost& cost : costs.entries) {
    if (!meter.status().ok()) return meter.status();
    const GatherOptions question = Question(meter, *map, photons.positions, kind, found);
    cost = CostOf(meter, *map, photons.positions, question);
    found *= 2;
  }
  if (!meter.status().ok()) return meter.status();
  return costs;
}

absl::StatusOr<GatherCosts> GatherCostsOfDevice::Find(GatherKind kind,
                                                      const CancelCheck& cancelled) {
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = costs_.find(kind); found != costs_.end()) return found->second;
  }
  const auto measured = MeasureGatherCosts(builder_, kind, cancelled);
  if (!measured.ok()) return measured.status();
  const std::lock_guard lock(mutex_);
  return costs_.emplace(kind, *measured).first->second;
}

std::uint64_t GatherCostsOfDevice::WorkBytes(GatherKind kind) const {
  const std::lock_guard lock(mutex_);
  return costs_.contains(kind) ? 0 : kMeasureBytes;
}

}  // namespace treelight
