#ifndef TREELIGHT_CLIENT_RENDER_PASS_PLAN_H_
#define TREELIGHT_CLIENT_RENDER_PASS_PLAN_H_

#include <cstdint>
#include <optional>

namespace treelight::client {

/// What a pilot found of a scene: errors as ErrorEstimate has them, times in seconds. Photons are
/// those of the indirect map, or of the caustic one where there is no other; the second map
/// follows.
struct PilotFindings {
  std::uint64_t photons = 0;   ///< of one pilot map, > 0
  std::uint32_t k = 0;         ///< of its estimates, > 0
  double camera_variance = 0;  ///< of one camera sample of a pixel
  /// Part of it, [0, 1], that samples of the same quarter of a pixel have still: the less, the more
  /// of it comes from where in the pixel a sample lies, and the more stratified ones do.
  double within_quarter = 1;
  double photon_variance = 0;  ///< of an estimate of k photons; goes with 1 / k
  /// Part of it, (0, 1], that the samples of a pixel have in common, since they share photons.
  double shared = 1;
  double squared_difference = 0;  ///< that a quarter of the area makes, mean of its square

  double photon_s = 0;  ///< of a photon: traced, sent and built from, with its share of the others
  double camera_s = 0;  ///< of a camera sample
  double gather_s = 0, quarter_gather_s = 0;  ///< of the gathers of a sample, with k and with k / 4
  double pass_s = 0;                          ///< of a pass, however small
};

/// How a picture is made of passes of one radius.
struct PassPlan {
  std::uint64_t photons = 0;  ///< of a pass
  std::uint32_t k = 0, samples_per_pixel = 0;
  std::uint64_t passes = 0;
  double variance = 0, squared_bias = 0;  ///< of the mean of the passes, predicted
  double seconds = 0;                     ///< predicted
};

/// What PlanPasses does not choose. From fewer than min_samples too little is known of pixels that
/// a lamp's rim crosses: most have no ray that meets it.
struct PlanLimits {
  std::optional<std::uint32_t> k{}, samples_per_pixel{};
  std::uint64_t min_passes = 2, min_samples = 8;  ///< of a pixel, in all passes
  /// Passes of so many samples that both are kept.
  std::uint64_t MinPasses(std::uint32_t samples) const;
};

/// Squared bias of passes of `photons` and `k`. The difference is taken for half-way between that
/// of rims alone, whose square goes with the root of the area, and what PassStatistics takes it
/// for, which goes with the area itself: docs/rendering.md has what pictures have.
double PredictSquaredBias(const PilotFindings& pilot, std::uint64_t photons, std::uint32_t k);

/// Variance of one pass. Photon noise goes with 1 / k. The samples of a pixel share less of it the
/// smaller the disc of an estimate is beside the pixel. Noise of the camera goes with 1 / s, s
/// samples, but that of edges that cross the pixel with s^(-3/2), since samples are stratified: of
/// s cells an edge crosses about s^(1/2), each of which has 1 / s^2 of the pixel's variance. The
/// quarters of the pilot tell how much is of edges: of that a half is left within a quarter.
double PredictVariance(const PilotFindings& pilot, std::uint64_t photons, std::uint32_t k,
                       std::uint32_t samples_per_pixel);

/// Of passes whose mean has a root mean squared error of `target_error`, > 0, those that take the
/// least time, among k of 40 to 512, 1 to 64 samples a pixel and 5e3 to 1e7 photons a pass; where
/// none reaches it, those that come nearest. `pixels`, > 0, of the picture.
///
/// The mean of M passes of n photons and k neighbours is as noisy and as blurred as one pass of M n
/// photons and M k neighbours; but to find k nearest M times takes less time than M k once.
PassPlan PlanPasses(const PilotFindings& pilot, double target_error, std::uint64_t pixels,
                    const PlanLimits& limits);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PASS_PLAN_H_
