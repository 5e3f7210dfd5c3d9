#include "client/render/progressive_image.h"

namespace treelight::client {
namespace {

/// Distance of the pixels of the coarsest lattice; a power of 2.
constexpr int kCoarsest = 8;

}  // namespace

SampleOrder::SampleOrder(int width, int height, std::uint32_t samples_per_pixel, int stride)
    : width_(static_cast<std::uint32_t>(width)), samples_per_pixel_(samples_per_pixel) {
  pixels_.reserve(std::size_t(width) * std::size_t(height));
  for (int step = kCoarsest; step > 0; step /= 2) {
    if (step < kCoarsest && first_picture_ == 0) first_picture_ = pixels_.size();
    for (int y = 0; y < height; y += step) {
      for (int x = 0; x < width; x += step) {
        const bool taken = step < kCoarsest && x % (2 * step) == 0 && y % (2 * step) == 0;
        const bool wanted = x % stride == 0 && y % stride == 0;
        if (wanted && !taken) pixels_.push_back(static_cast<std::uint32_t>(y * width + x));
      }
    }
  }
}

PixelSample SampleOrder::At(std::uint64_t index) const {
  const std::uint32_t pixel = pixels_[index % pixels_.size()];
  return {.x = pixel % width_,
          .y = pixel / width_,
          .pixel = pixel,
          .sample = static_cast<std::uint32_t>(index / pixels_.size())};
}

ProgressiveImage::ProgressiveImage(int width, int height)
    : width_(width), height_(height), pixels_(std::size_t(width) * std::size_t(height)) {}

void ProgressiveImage::Add(std::uint32_t pixel, const Rgb& radiance) {
  Pixel& p = pixels_[pixel];
  p.sum[0] += radiance.r, p.sum[1] += radiance.g, p.sum[2] += radiance.b;
  ++p.count;
}

Image ProgressiveImage::Mean() const {
  Image image(width_, height_);
  const auto at = [this](int x, int y) {
    return std::size_t(y) * std::size_t(width_) + std::size_t(x);
  };
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      int step = 1;
      while (step < kCoarsest && pixels_[at(x - x % step, y - y % step)].count == 0) step *= 2;
      const Pixel& p = pixels_[at(x - x % step, y - y % step)];
      if (p.count == 0) continue;
      image.pixels[at(x, y)] = {static_cast<float>(p.sum[0] / p.count),
                                static_cast<float>(p.sum[1] / p.count),
                                static_cast<float>(p.sum[2] / p.count)};
    }
  }
  return image;
}

void PreviewClock::Update(const std::function<Image()>& make) {
  if (!options_.show) return;
  const auto interval = std::chrono::duration<double>(options_.interval_s);
  if (shown_at_ && std::chrono::steady_clock::now() - *shown_at_ < interval) return;
  options_.show(make());
  shown_at_ = std::chrono::steady_clock::now();
}

}  // namespace treelight::client
