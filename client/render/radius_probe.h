#ifndef TREELIGHT_CLIENT_RENDER_RADIUS_PROBE_H_
#define TREELIGHT_CLIENT_RENDER_RADIUS_PROBE_H_

#include <array>
#include <cstdint>
#include <vector>

#include "client/render/camera_pass.h"
#include "client/render/image.h"
#include "client/render/map_gather.h"
#include "client/render/progressive_image.h"

namespace treelight::client {

/// The estimate over a quarter of the area: half the radius, a quarter of the neighbours.
EstimateOptions QuarterOf(const EstimateOptions& estimate);

/// How a picture changes where its photons are gathered over a quarter of the area, from the same
/// photons at the same points: what the radius blurs, since that grows with the area. Looked at on
/// a lattice of pixels, which is enough for a mean over the picture.
class RadiusProbe {
 public:
  static constexpr std::uint32_t kStride = 2;  ///< every second pixel of every second row

  /// Of a picture whose samples are those of `order`, which must outlive it.
  RadiusProbe(const SampleOrder& order, int width, int height);

  /// The points of `points` that lie on the lattice; `first_sample` is that of their batch.
  GatherPoints Select(const GatherPoints& points, std::uint64_t first_sample) const;

  /// Light of a sample that was gathered over the whole area, or over a quarter of it.
  void AddWhole(std::uint64_t sample, const Rgb& radiance) { Add(sample, radiance, -1); }
  void AddQuarter(std::uint64_t sample, const Rgb& radiance) { Add(sample, radiance, 1); }

  /// Radiance over the quarter less that over the whole, mean of the samples of each pixel of the
  /// lattice: pixel (x, y) is that at (kStride x, kStride y) of the picture.
  Image Difference() const;

 private:
  void Add(std::uint64_t sample, const Rgb& radiance, double sign);
  /// Index in sums_; -1: not on the lattice.
  std::int64_t PlaceOf(std::uint64_t sample) const;

  const SampleOrder& order_;
  int width_, height_;  // of the lattice
  double samples_per_pixel_;
  std::vector<std::array<double, 3>> sums_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_RADIUS_PROBE_H_
