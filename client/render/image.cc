#include "client/render/image.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "fmt/format.h"

namespace treelight::client {

absl::StatusOr<ImageError> Compare(const Image& picture, const Image& reference) {
  if (picture.width != reference.width || picture.height != reference.height) {
    return absl::InvalidArgumentError(fmt::format("the picture is {} x {}, its reference {} x {}",
                                                  picture.width, picture.height, reference.width,
                                                  reference.height));
  }
  double squares = 0, clipped_squares = 0, relative = 0, picture_sum = 0, reference_sum = 0;
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    const Rgb &p = picture.pixels[i], &q = reference.pixels[i];
    for (const auto& [a, b] :
         std::array<std::array<double, 2>, 3>{{{p.r, q.r}, {p.g, q.g}, {p.b, q.b}}}) {
      squares += (a - b) * (a - b);
      const double clipped = std::min<double>(a, kClip) - std::min<double>(b, kClip);
      clipped_squares += clipped * clipped;
      relative += (a - b) * (a - b) / (b * b + 0.01);
      picture_sum += a;
      reference_sum += b;
    }
  }
  const double count = 3.0 * static_cast<double>(picture.pixels.size());
  return ImageError{.rmse = count > 0 ? std::sqrt(squares / count) : 0,
                    .clipped_rmse = count > 0 ? std::sqrt(clipped_squares / count) : 0,
                    .relative_mse = count > 0 ? relative / count : 0,
                    .mean_ratio = picture_sum == reference_sum ? 1 : picture_sum / reference_sum};
}

}  // namespace treelight::client
