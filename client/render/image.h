#ifndef TREELIGHT_CLIENT_RENDER_IMAGE_H_
#define TREELIGHT_CLIENT_RENDER_IMAGE_H_

#include <cstddef>
#include <vector>

#include "absl/status/statusor.h"
#include "client/scenes/color.h"

namespace treelight::client {

/// Linear radiance, W / unit^2 / sr.
struct Image {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;  ///< [width * height] rows from the top, each from the left

  Image() = default;  ///< no pixels
  /// Black.
  Image(int columns, int rows)
      : width(columns), height(rows), pixels(std::size_t(columns) * std::size_t(rows)) {}
};

/// How far a picture is from its reference, over all pixels and channels.
struct ImageError {
  double rmse = 0;  ///< root of the mean squared difference
  /// Likewise with values above kClip taken as kClip: else the few pixels that the rim of a lamp
  /// crosses outweigh all others.
  double clipped_rmse = 0;
  /// Mean of (a - b)^2 / (b^2 + 0.01), b the reference: errors in the dark count too (Rousselle et
  /// al. 2011, "Adaptive Sampling and Reconstruction using Greedy Error Minimization", section 6).
  double relative_mse = 0;
  double mean_ratio = 1;  ///< mean of the picture / mean of the reference: 1 where there is no bias
};

/// What a surface is, beside what it looks like: for denoisers and compositing. Of what a pixel
/// sees first that is not mirror, glass or pane, mean over its samples, weighted as its light is.
struct FeatureLayers {
  Image albedo;   ///< share of light reflected, [0, 1]; what shines is 1; 0 where nothing is seen
  Image normals;  ///< shading normal in world space, x, y, z as r, g, b; on the viewer's side
};

/// About what is white in a picture of middle exposure, W / unit^2 / sr.
inline constexpr float kClip = 1;

/// Compares `picture` with `reference`. INVALID_ARGUMENT: the sizes differ.
absl::StatusOr<ImageError> Compare(const Image& picture, const Image& reference);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_IMAGE_H_
