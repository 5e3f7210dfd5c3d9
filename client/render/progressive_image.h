#ifndef TREELIGHT_CLIENT_RENDER_PROGRESSIVE_IMAGE_H_
#define TREELIGHT_CLIENT_RENDER_PROGRESSIVE_IMAGE_H_

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "client/render/image.h"

namespace treelight::client {

/// One sample of one pixel.
struct PixelSample {
  std::uint32_t x = 0, y = 0;  ///< of the pixel
  std::uint32_t pixel = 0;     ///< y * width + x
  std::uint32_t sample = 0;    ///< of the pixel
};

/// The order in which the samples of a picture are taken, so that all of it is seen early: first
/// one sample of every pixel, every eighth pixel of every eighth row before all others, then every
/// fourth, every second, and the rest; then the second sample of every pixel in the same order.
class SampleOrder {
 public:
  /// Of a picture of `width` x `height` pixels, > 0; of them every `stride`-th of every stride-th
  /// row, > 0.
  SampleOrder(int width, int height, std::uint32_t samples_per_pixel, int stride = 1);

  std::uint32_t samples_per_pixel() const { return samples_per_pixel_; }
  std::uint64_t size() const { return std::uint64_t{samples_per_pixel_} * pixels_.size(); }

  /// Samples after which all of the picture is seen, coarsely.
  std::uint64_t first_picture() const { return first_picture_; }

  /// Sample `index` < size().
  PixelSample At(std::uint64_t index) const;

 private:
  std::uint32_t width_, samples_per_pixel_;
  std::vector<std::uint32_t> pixels_;  // in order
  std::uint64_t first_picture_ = 0;
};

/// A picture whose pixels get their samples one by one.
class ProgressiveImage {
 public:
  ProgressiveImage(int width, int height);

  void Add(std::uint32_t pixel, const Rgb& radiance);

  /// The mean of the samples of each pixel. A pixel without one has the colour of the nearest pixel
  /// left of and above it that SampleOrder takes before it; black where that has none either.
  Image Mean() const;

 private:
  struct Pixel {
    std::array<double, 3> sum{};  // in double: thousands of samples are added
    std::uint32_t count = 0;
  };
  int width_, height_;
  std::vector<Pixel> pixels_;
};

/// Who is shown a picture while it is rendered, and how often. Showing it changes nothing in it.
struct PreviewOptions {
  /// Gets the picture as it is, on the calling thread of the renderer; empty: nobody.
  std::function<void(const Image& image)> show{};
  double interval_s = 2;  ///< between the end of one call and the next, seconds
};

/// Tells when a preview is due: at once, then at every interval.
class PreviewClock {
 public:
  explicit PreviewClock(const PreviewOptions& options) : options_(options) {}

  /// Shows what `make` gives, where that is due.
  void Update(const std::function<Image()>& make);

 private:
  const PreviewOptions& options_;
  std::optional<std::chrono::steady_clock::time_point> shown_at_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PROGRESSIVE_IMAGE_H_
