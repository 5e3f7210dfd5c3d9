#include "client/render/progressive_image.h"

#include <set>
#include <utility>

#include "gtest/gtest.h"

namespace treelight::client {
namespace {

TEST(SampleOrder, TakesEverySampleOnce) {
  for (const auto& [width, height] : {std::pair{1, 1}, {8, 8}, {9, 7}, {33, 17}, {3, 20}}) {
    const SampleOrder order(width, height, 3);
    ASSERT_EQ(order.size(), 3u * width * height);
    std::set<std::pair<std::uint32_t, std::uint32_t>> taken;
    for (std::uint64_t i = 0; i < order.size(); ++i) {
      const PixelSample s = order.At(i);
      EXPECT_LT(s.x, std::uint32_t(width));
      EXPECT_EQ(s.pixel, s.y * width + s.x);
      EXPECT_EQ(s.sample, i / (std::uint64_t(width) * height));
      taken.insert({s.pixel, s.sample});
    }
    EXPECT_EQ(taken.size(), order.size());
  }
}

TEST(SampleOrder, TakesTheSamplesOfALatticeAlone) {
  for (const int stride : {1, 2, 3, 6, 16, 40}) {
    const SampleOrder order(33, 17, 2, stride);
    const auto side = [stride](int pixels) { return (pixels + stride - 1) / stride; };
    EXPECT_EQ(order.size(), 2u * side(33) * side(17)) << stride;
    EXPECT_EQ(order.samples_per_pixel(), 2u);
    std::set<std::pair<std::uint32_t, std::uint32_t>> taken;
    for (std::uint64_t i = 0; i < order.size(); ++i) {
      const PixelSample s = order.At(i);
      EXPECT_TRUE(s.x % stride == 0 && s.y % stride == 0) << stride;
      taken.insert({s.pixel, s.sample});
    }
    EXPECT_EQ(taken.size(), order.size()) << stride;
  }
}

TEST(SampleOrder, GoesFromCoarseToFine) {
  const SampleOrder order(32, 24, 1);
  EXPECT_EQ(order.first_picture(), 12u);
  for (std::uint64_t i = 0; i < order.size(); ++i) {
    const PixelSample s = order.At(i);
    // 4 x 3 pixels of every eighth row and column, then 8 x 6 of every fourth, and so on.
    const std::uint32_t step = i < 12 ? 8 : i < 48 ? 4 : i < 192 ? 2 : 1;
    EXPECT_EQ(s.x % step, 0u) << i;
    EXPECT_EQ(s.y % step, 0u) << i;
  }
}

TEST(ProgressiveImage, EverySampleWeighsTheSame) {
  ProgressiveImage image(2, 1);
  image.Add(0, {1, 2, 3});
  image.Add(1, {4, 4, 4});
  image.Add(0, {3, 2, 1});
  EXPECT_EQ(image.Mean().pixels, (std::vector<Rgb>{{2, 2, 2}, {4, 4, 4}}));
}

TEST(ProgressiveImage, PixelsWithoutSampleShowTheCoarserPicture) {
  constexpr int kWidth = 21, kHeight = 13;
  const SampleOrder order(kWidth, kHeight, 1);
  ProgressiveImage image(kWidth, kHeight);
  for (const Rgb& pixel : image.Mean().pixels) EXPECT_EQ(pixel, Rgb{});
  // At each moment every pixel shows the place of one that was taken, and its own once it was.
  for (std::uint64_t i = 0; i < order.size(); ++i) {
    const PixelSample s = order.At(i);
    image.Add(s.pixel, {float(s.x), float(s.y), 1});
    if (i + 1 < 6) continue;  // the coarsest pixels are 3 x 2
    const int step = i + 1 < 24 ? 8 : i + 1 < 77 ? 4 : 2;
    const Image mean = image.Mean();
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Rgb& shown = mean.pixels[y * kWidth + x];
        ASSERT_EQ(shown.b, 1) << i;
        ASSERT_LT(x - shown.r, step) << i;
        ASSERT_LT(y - shown.g, step) << i;
      }
    }
  }
  const Image mean = image.Mean();
  for (int i = 0; i < kWidth * kHeight; ++i)
    ASSERT_EQ(mean.pixels[i], (Rgb{float(i % kWidth), float(i / kWidth), 1}));
}

TEST(PreviewClock, ShowsAtOnceAndThenAtIntervals) {
  int shown = 0, made = 0;
  const PreviewOptions options{.show = [&](const Image&) { ++shown; }, .interval_s = 3600};
  PreviewClock clock(options);
  for (int i = 0; i < 3; ++i) {
    clock.Update([&] {
      ++made;
      return Image(1, 1);
    });
  }
  EXPECT_EQ(shown, 1);
  EXPECT_EQ(made, 1);
  const PreviewOptions always{.show = [&](const Image&) { ++shown; }, .interval_s = 0};
  PreviewClock eager(always);
  for (int i = 0; i < 3; ++i) eager.Update([] { return Image(1, 1); });
  EXPECT_EQ(shown, 4);
  const PreviewOptions nobody;
  PreviewClock idle(nobody);
  idle.Update([]() -> Image {
    ADD_FAILURE() << "nobody looks";
    return {};
  });
}

}  // namespace
}  // namespace treelight::client
