#include "client/render/pass_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "client/render/pass_statistics.h"
#include "client/render/radius_probe.h"

namespace treelight::client {
namespace {

constexpr std::array<std::uint32_t, 9> kNeighbors = {40, 48, 64, 96, 128, 192, 256, 384, 512};
/// Squares: JitterInPixel stratifies those best.
constexpr std::array<std::uint32_t, 7> kSamples = {1, 4, 9, 16, 25, 36, 64};
constexpr double kMinPhotons = 5e3, kMaxPhotons = 1e7;
constexpr double kMostPasses = 1e6;
/// Of the variance that is predicted: where few passes are nearly too few, one more may follow.
constexpr double kUncertainty = 0.35;
/// Of the area in the squared blur; kRimShare goes with 1/2, kDifferenceShare with 1.
constexpr double kBlurPower = 0.75;
/// One in so many pixels is probed for blur.
constexpr double kPixelsPerProbe = RadiusProbe::kStride * RadiusProbe::kStride;

/// Area of an estimate beside that of the pilot.
double RelativeArea(const PilotFindings& pilot, std::uint64_t photons, std::uint32_t k) {
  return static_cast<double>(k) / pilot.k * static_cast<double>(pilot.photons) /
         static_cast<double>(photons);
}

/// Time of the gathers of a sample; a line in k through the two that were measured.
double GatherSeconds(const PilotFindings& pilot, double k) {
  const double slope = (pilot.gather_s - pilot.quarter_gather_s) / (0.75 * pilot.k);
  return std::max(0.0, pilot.gather_s + slope * (k - pilot.k));
}

double PassSeconds(const PilotFindings& pilot, const PassPlan& plan, std::uint64_t pixels) {
  const double samples = static_cast<double>(pixels) * plan.samples_per_pixel;
  const double probe = GatherSeconds(pilot, plan.k / 4.0) / kPixelsPerProbe;
  return pilot.pass_s + static_cast<double>(plan.photons) * pilot.photon_s +
         samples * (pilot.camera_s + GatherSeconds(pilot, plan.k) + probe);
}

/// Variance by the camera of the mean of `samples` of a pixel. Those that do not fill a square grid
/// lie anywhere (JitterInPixel).
double CameraVariance(const PilotFindings& pilot, std::uint32_t samples) {
  const double edges = std::clamp(2 * (1 - pilot.within_quarter), 0.0, 1.0);
  const double side = std::floor(std::sqrt(static_cast<double>(samples)));
  const double cells = side * side;
  const double of_sum = edges * side + (1 - edges) * cells + (samples - cells);
  return pilot.camera_variance * of_sum / samples / samples;
}

/// Completes `plan` with as many passes as the target takes; false: no number is enough.
bool Complete(const PilotFindings& pilot, double target_error, std::uint64_t pixels,
              std::uint64_t min_passes, PassPlan& plan) {
  const double variance = PredictVariance(pilot, plan.photons, plan.k, plan.samples_per_pixel);
  plan.squared_bias = PredictSquaredBias(pilot, plan.photons, plan.k);
  const double left = target_error * target_error - plan.squared_bias;
  const double passes = left > 0 ? variance / left : kMostPasses;
  plan.passes =
      std::max(min_passes, static_cast<std::uint64_t>(std::ceil(std::min(passes, kMostPasses))));
  plan.variance = variance / static_cast<double>(plan.passes);
  double expected_passes = 0;
  for (const double factor : {1 - kUncertainty, 1.0, 1 + kUncertainty})
    expected_passes += std::max(static_cast<double>(min_passes), std::ceil(factor * passes)) / 3;
  plan.seconds = expected_passes * PassSeconds(pilot, plan, pixels);
  return passes < kMostPasses;
}

}  // namespace

std::uint64_t PlanLimits::MinPasses(std::uint32_t samples) const {
  return std::max(min_passes, (min_samples + samples - 1) / samples);
}

double PredictSquaredBias(const PilotFindings& pilot, std::uint64_t photons, std::uint32_t k) {
  static const double kShare =
      std::sqrt(PassStatistics::kRimShare * PassStatistics::kDifferenceShare);
  return pilot.squared_difference / kShare * std::pow(RelativeArea(pilot, photons, k), kBlurPower);
}

double PredictVariance(const PilotFindings& pilot, std::uint64_t photons, std::uint32_t k,
                       std::uint32_t samples_per_pixel) {
  // A pixel of area A over discs of area a: 1 / (1 + A / a) of the noise is shared.
  const double pixel_area = (1 - pilot.shared) / pilot.shared;
  const double shared = 1 / (1 + pixel_area / RelativeArea(pilot, photons, k));
  const double photon_variance = pilot.photon_variance * pilot.k / k;
  return photon_variance * shared + photon_variance * (1 - shared) / samples_per_pixel +
         CameraVariance(pilot, samples_per_pixel);
}

PassPlan PlanPasses(const PilotFindings& pilot, double target_error, std::uint64_t pixels,
                    const PlanLimits& limits) {
  PassPlan best, nearest;
  best.seconds = std::numeric_limits<double>::infinity();
  nearest.squared_bias = std::numeric_limits<double>::infinity();
  for (const std::uint32_t k : kNeighbors) {
    for (const std::uint32_t samples : kSamples) {
      for (double photons = kMinPhotons; photons <= kMaxPhotons; photons *= std::sqrt(2)) {
        PassPlan plan{.photons = static_cast<std::uint64_t>(photons),
                      .k = limits.k.value_or(k),
                      .samples_per_pixel = limits.samples_per_pixel.value_or(samples)};
        if (Complete(pilot, target_error, pixels, limits.MinPasses(plan.samples_per_pixel), plan)) {
          if (plan.seconds < best.seconds) best = plan;
        } else if (plan.squared_bias < nearest.squared_bias) {
          nearest = plan;
        }
      }
    }
  }
  return best.passes > 0 ? best : nearest;
}

}  // namespace treelight::client
