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
/// Blur: to the leading order the bias of a pass is B s, s its squared radius; a pass that was
/// gathered over a quarter of the area too differs by -3/4 B s from itself. B of each pixel is the
/// sum of such differences over the sum of s. Squared it would be as large as its noise; so it is
/// found twice, from odd and from even passes, which are independent, and the product of the two is
/// the square without it. The mean of passes has the bias B mean(s).
class PassStatistics {
 public:
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
    double squared_scales = 0;
    std::uint64_t passes = 0;
  };
  double SquaredBias() const;

  int width_, height_;
  std::uint64_t passes_ = 0;
  double squared_scales_ = 0;
  std::vector<Pixel> pixels_;
  std::array<Half, 2> halves_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PASS_STATISTICS_H_
