#include "client/render/planned_renderer.h"

#include <algorithm>

#include "client/render/stopwatch.h"

namespace treelight::client {
namespace {

/// Passes are too blurred where the square of it is more than was planned by such a factor, but not
/// before it is the first of these parts of the error that is asked for, nor later than at the
/// second.
constexpr double kMoreThanPlanned = 1.5, kMuch = 0.75, kTooMuch = 0.95;

}  // namespace

absl::StatusOr<ProgressiveResult> RenderPlanned(
    const Intersector& intersector, PhotonMapClient& client, const ProgressiveOptions& options,
    const PlanLimits& limits, const std::function<absl::Status(const PilotPlan&)>& planned) {
  auto found = PlanByPilots(intersector, client, options, limits);
  if (!found.ok()) return found.status();
  const double allowed = options.target_error * options.target_error;
  const auto pixels = std::uint64_t(options.pass.width) * std::uint64_t(options.pass.height);
  const Stopwatch begin;
  while (true) {
    if (auto status = planned(*found); !status.ok()) return status;
    const PassPlan& plan = found->plan;
    ProgressiveOptions passes = Planned(options, plan);
    passes.min_passes_of_target = limits.MinPasses(plan.samples_per_pixel);
    passes.time_limit_s = std::max(0.0, options.time_limit_s - begin.Seconds());
    if (plan.squared_bias > 0 && plan.squared_bias < allowed) {
      passes.max_squared_bias =
          std::clamp(kMoreThanPlanned * plan.squared_bias, kMuch * allowed, kTooMuch * allowed);
    }
    auto result = RenderProgressively(intersector, client, passes);
    if (!result.ok() || result->end != ProgressiveEnd::kTooBlurred) return result;
    found->pilot.findings.squared_difference *=
        result->last.error->squared_bias / plan.squared_bias;
    found->plan = PlanPasses(found->pilot.findings, options.target_error, pixels, limits);
  }
}

}  // namespace treelight::client
