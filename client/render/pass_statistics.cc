#include "client/render/pass_statistics.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "client/render/radius_probe.h"

namespace treelight::client {
namespace {

constexpr double kDark = 0.01;  // as ImageError::relative_mse

std::array<double, 3> ChannelsOf(const Rgb& color) { return {color.r, color.g, color.b}; }

}  // namespace

double ErrorEstimate::relative_rms() const { return std::sqrt(relative_mse()); }

PassStatistics::PassStatistics(int width, int height)
    : width_(width), height_(height), pixels_(std::size_t(width) * std::size_t(height)) {}

void PassStatistics::Add(const Image& pass, double squared_scale, const Image* difference) {
  assert(pass.width == width_ && pass.height == height_ && squared_scale > 0);
  ++passes_;
  const double radius = std::sqrt(squared_scale);
  radii_ += radius;
  const auto count = static_cast<double>(passes_);
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const Channels value = ChannelsOf(pass.pixels[i]);
    for (int c = 0; c < 3; ++c) {
      const double before = value[c] - pixels_[i].mean[c];
      pixels_[i].mean[c] += before / count;
      pixels_[i].squares[c] += before * (value[c] - pixels_[i].mean[c]);
    }
  }
  if (difference == nullptr) return;
  Half& half = halves_[(halves_[0].passes + halves_[1].passes) % 2];
  half.sums.resize(difference->pixels.size());
  for (std::size_t i = 0; i < half.sums.size(); ++i) {
    const Channels value = ChannelsOf(difference->pixels[i]);
    for (int c = 0; c < 3; ++c) half.sums[i][c] += value[c];
  }
  half.radii += radius;
  ++half.passes;
}

Image PassStatistics::Mean() const {
  Image image(width_, height_);
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const Channels& mean = pixels_[i].mean;
    image.pixels[i] = {static_cast<float>(mean[0]), static_cast<float>(mean[1]),
                       static_cast<float>(mean[2])};
  }
  return image;
}

ErrorEstimate PassStatistics::Estimate() const {
  assert(passes_ >= 2);
  ErrorEstimate estimate;
  const auto count = static_cast<double>(passes_);
  for (const Pixel& pixel : pixels_) {
    for (int c = 0; c < 3; ++c) {
      const double variance = pixel.squares[c] / (count - 1) / count;
      estimate.variance += variance / (pixel.mean[c] * pixel.mean[c] + kDark);
    }
  }
  estimate.variance /= 3 * static_cast<double>(pixels_.size());
  estimate.knows_bias = halves_[1].passes > 0;
  if (estimate.knows_bias) estimate.squared_bias = std::max(0.0, SquaredBias());
  return estimate;
}

double PassStatistics::SquaredBias() const {
  // The sums of both halves to means of passes of which all had a difference.
  const double mean_radius = radii_ / static_cast<double>(passes_);
  const double to_bias =
      mean_radius * mean_radius / halves_[0].radii / halves_[1].radii / kDifferenceShare;
  const int columns = (width_ + static_cast<int>(RadiusProbe::kStride) - 1) / RadiusProbe::kStride;
  double sum = 0;
  for (std::size_t i = 0; i < halves_[0].sums.size(); ++i) {
    const auto x = i % columns * RadiusProbe::kStride, y = i / columns * RadiusProbe::kStride;
    const Channels& mean = pixels_[y * width_ + x].mean;
    for (int c = 0; c < 3; ++c) {
      sum += to_bias * halves_[0].sums[i][c] * halves_[1].sums[i][c] / (mean[c] * mean[c] + kDark);
    }
  }
  return sum / (3 * static_cast<double>(halves_[0].sums.size()));
}

}  // namespace treelight::client
