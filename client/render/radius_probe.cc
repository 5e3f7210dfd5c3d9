#include "client/render/radius_probe.h"

namespace treelight::client {
namespace {

/// Pixels of the lattice along a side of `pixels`.
int LatticeSide(int pixels) {
  constexpr int kStride = RadiusProbe::kStride;
  return (pixels + kStride - 1) / kStride;
}

}  // namespace

EstimateOptions QuarterOf(const EstimateOptions& estimate) {
  EstimateOptions quarter = estimate;
  quarter.k = estimate.k / 4;
  quarter.radius = estimate.radius / 2;
  return quarter;
}

RadiusProbe::RadiusProbe(const SampleOrder& order, int width, int height)
    : order_(order),
      width_(LatticeSide(width)),
      height_(LatticeSide(height)),
      samples_per_pixel_(order.samples_per_pixel()),
      sums_(std::size_t(width_) * std::size_t(height_)) {}

GatherPoints RadiusProbe::Select(const GatherPoints& points, std::uint64_t first_sample) const {
  GatherPoints selected;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (PlaceOf(first_sample + points.samples[i]) < 0) continue;
    const auto copy = [i](const std::vector<float>& from, std::vector<float>& to) {
      to.insert(to.end(), from.begin() + 3 * i, from.begin() + 3 * i + 3);
    };
    copy(points.positions, selected.positions);
    copy(points.normals, selected.normals);
    selected.samples.push_back(points.samples[i]);
    selected.weights.push_back(points.weights[i]);
  }
  return selected;
}

Image RadiusProbe::Difference() const {
  Image difference(width_, height_);
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    const auto mean = [&](int c) { return static_cast<float>(sums_[i][c] / samples_per_pixel_); };
    difference.pixels[i] = {mean(0), mean(1), mean(2)};
  }
  return difference;
}

void RadiusProbe::Add(std::uint64_t sample, const Rgb& radiance, double sign) {
  const std::int64_t place = PlaceOf(sample);
  if (place < 0) return;
  auto& sum = sums_[place];
  sum[0] += sign * radiance.r, sum[1] += sign * radiance.g, sum[2] += sign * radiance.b;
}

std::int64_t RadiusProbe::PlaceOf(std::uint64_t sample) const {
  const PixelSample place = order_.At(sample);
  if (place.x % kStride != 0 || place.y % kStride != 0) return -1;
  return std::int64_t(place.y / kStride) * width_ + place.x / kStride;
}

}  // namespace treelight::client
