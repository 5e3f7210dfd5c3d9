#include "client/render/difference.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace treelight::client {
namespace {

/// Of pixels that are below the scale.
constexpr double kShare = 0.99;

float MeanChannel(const Rgb& c) { return (c.r + c.g + c.b) / 3; }

/// The difference below which kShare of the pixels are; 1 where all are the same.
float FindScale(const Image& difference) {
  std::vector<float> magnitudes;
  magnitudes.reserve(difference.pixels.size());
  for (const Rgb& pixel : difference.pixels) {
    const float magnitude = std::fabs(MeanChannel(pixel));
    if (std::isfinite(magnitude)) magnitudes.push_back(magnitude);
  }
  if (magnitudes.empty()) return 1;
  const auto place = magnitudes.begin() + static_cast<std::ptrdiff_t>(
                                              kShare * static_cast<double>(magnitudes.size() - 1));
  std::ranges::nth_element(magnitudes, place);
  if (*place > 0) return *place;
  const float largest = std::ranges::max(magnitudes);
  return largest > 0 ? largest : 1;
}

/// From blue over white to red, `value` in [-1, 1]: what differs loses the other two channels.
Rgb DivergingColor(float value) {
  if (std::isnan(value)) return {0, 0, 0};
  const float fade = 1 - std::min(std::fabs(value), 1.0f);
  return value > 0 ? Rgb{1, fade, fade} : Rgb{fade, fade, 1};
}

}  // namespace

absl::StatusOr<Difference> ShowDifference(const Image& picture, const Image& reference,
                                          float scale) {
  if (const auto sizes = Compare(picture, reference); !sizes.ok()) return sizes.status();
  Difference difference{.signed_difference = Image(picture.width, picture.height),
                        .colors = Image(picture.width, picture.height)};
  for (std::size_t i = 0; i < picture.pixels.size(); ++i)
    difference.signed_difference.pixels[i] = picture.pixels[i] - reference.pixels[i];
  difference.scale = scale > 0 ? scale : FindScale(difference.signed_difference);
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    difference.colors.pixels[i] =
        DivergingColor(MeanChannel(difference.signed_difference.pixels[i]) / difference.scale);
  }
  return difference;
}

}  // namespace treelight::client
