#ifndef TREELIGHT_CLIENT_RENDER_PASS_STATISTICS_H_
#define TREELIGHT_CLIENT_RENDER_PASS_STATISTICS_H_

#include <array>
#include <cstdint>
#include <vector>

#include "client/render/image.h"

namespace treelight::client {

/// How far the mean of passes is from the truth, as the passes themselves tell. Both parts are
/// relative squares as in ImageError::relative_mse, with the mean of the passes for the reference:
/// mean over pixels and channels of e^2 / (L^2 + 0.01).
struct ErrorEstimate {
  double variance = 0;      ///< noise
  double squared_bias = 0;  ///< what radii blur; 0 where it is not known
  bool knows_bias = false;

  double relative_mse() const { return variance + squared_bias; }
  double relative_rms() const;
};

/// The mean of independent passes of one picture, and what they tell of its error.
///
/// Noise: passes are independent, so the variance of their mean is the variance among them, divided
/// by their count. That passes of larger radii have less noise and more blur than later ones makes
/// it a little too large.
///
/// Blur: bias of a density estimate comes from two places. Where the light curves it goes with the
/// squared radius s, to the leading order; within a radius of an edge a share of the disc is
/// missing whatever the radius is, and only the width of that rim goes with it. Squared and summed
/// over a picture the first goes with s^2, the second with s^(1/2). A pass that was gathered over a
/// quarter of the area too differs from itself by a part of its bias; the squares add up to
/// kCurveShare of those of the bias in the first case and kRimShare in the second. Pictures lie
/// between, so that the geometric mean of both is taken, and s for the power: the root of the
/// squared bias is then off by at most sqrt(sqrt(kCurveShare / kRimShare)) = 1.27 in either case,
/// while all passes have differences. Their square would be as large as their noise; so it is found
/// twice, from odd and from even passes, which are independent, and the product of the two is the
/// square without it.
class PassStatistics {
 public:
  /// (1 - 1/4)^2.
  static constexpr double kCurveShare = 9.0 / 16;
  /// Integral over t in [0, 1] of (f(t) - f(2t))^2 over that of f(t)^2, f(t) the share of the
  /// Epanechnikov kernel beyond a straight edge at distance t of its radius; 0.21 to 0.23 of the
  /// other kernels.
  static constexpr double kRimShare = 0.216;
  /// sqrt(kCurveShare * kRimShare)
  static constexpr double kDifferenceShare = 0.3486;

  PassStatistics(int width, int height);

  /// Adds a pass. `squared_scale`: squared radius, in any unit that is the same for all passes, >
  /// 0. `difference` of RadiusProbe, or null.
  void Add(const Image& pass, double squared_scale, const Image* difference);

  std::uint64_t passes() const { return passes_; }

  /// Mean of the passes; black where there is none.
  Image Mean() const;

  /// After at least two passes. Nothing is known of the bias before two passes had a difference.
  ErrorEstimate Estimate() const;

 private:
  using Channels = std::array<double, 3>;
  struct Pixel {
    Channels mean{};
    Channels squares{};  // of deviations from the mean (Welford 1962)
  };
  /// Differences of every second pass that has one.
  struct Half {
    std::vector<Channels> sums;
    double radii = 0;
    std::uint64_t passes = 0;
  };
  double SquaredBias() const;

  int width_, height_;
  std::uint64_t passes_ = 0;
  double radii_ = 0;  // sum
  std::vector<Pixel> pixels_;
  std::array<Half, 2> halves_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PASS_STATISTICS_H_
