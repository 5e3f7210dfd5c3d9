#include "client/render/path_tracer.h"

#include <cmath>

#include "client/render/camera_rays.h"
#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeFurnace;
using ::treelight::testing::MakeLampOverFloor;
using ::treelight::testing::MustIntersect;

PathTracedImage MustPathTrace(const Scene& scene, const PathTraceOptions& options) {
  auto image = PathTrace(MustIntersect(scene), options);
  EXPECT_TRUE(image.ok()) << image.status();
  return *std::move(image);
}

double Mean(const Image& image) {
  double sum = 0;
  for (const Rgb& pixel : image.pixels) sum += (pixel.r + pixel.g + pixel.b) / 3;
  return sum / static_cast<double>(image.pixels.size());
}

// However it is furnished, the radiance in a furnace is E / (1 - rho).
TEST(PathTracer, FurnaceHasTheAnalyticRadiance) {
  for (const float rho : {0.0f, 0.5f, 0.8f}) {
    Scene furnace = MakeFurnace(rho, 2);
    furnace.materials.push_back(
        {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f});
    furnace.materials.push_back(
        {.name = "mirror", .surface = Surface::kMirror, .reflectance = {1, 1, 1}});
    furnace.spheres = {{.center = {0.3f, 0.3f, 0.3f}, .radius = 0.2f, .material = 1},
                       {.center = {0.7f, 0.7f, 0.4f}, .radius = 0.2f, .material = 2}};
    const auto traced =
        MustPathTrace(furnace, {.width = 32, .height = 32, .samples_per_pixel = 64, .seed = 1});
    const double expected = 2 / (1 - rho);
    EXPECT_NEAR(Mean(traced.image), expected, 0.01 * expected) << rho;
    for (const Rgb& pixel : traced.image.pixels)
      ASSERT_NEAR(pixel.g, expected, 0.5 * expected) << rho;
  }
}

// Straight below a small lamp: E = L A / d^2, seen as rho / pi * E.
TEST(PathTracer, SmallLampHasTheAnalyticRadiance) {
  const auto traced = MustPathTrace(MakeLampOverFloor(100, 0.05f),
                                    {.width = 4, .height = 4, .samples_per_pixel = 256, .seed = 2});
  const double expected = 0.5 / M_PI * 100 * 0.05 * 0.05;
  for (const Rgb& pixel : traced.image.pixels) EXPECT_NEAR(pixel.r, expected, 0.01 * expected);
}

TEST(PathTracer, WhatIsHiddenFromTheLampIsBlack) {
  Scene scene = MakeLampOverFloor(100, 0.05f);
  scene.materials.push_back({.name = "black", .reflectance = {}});
  scene.spheres = {{.center = {0, 0.75f, 0}, .radius = 0.1f, .material = 2}};
  const auto traced =
      MustPathTrace(scene, {.width = 4, .height = 4, .samples_per_pixel = 16, .seed = 6});
  for (const Rgb& pixel : traced.image.pixels) EXPECT_EQ(pixel, Rgb{});
}

TEST(PathTracer, TheBackOfALampIsBlack) {
  Scene scene = MakeLampOverFloor(100, 0.5f);
  scene.camera = {
      .position = {0, 3, 0}, .target = {0, 0, 0}, .up = {0, 0, 1}, .vertical_fov_degrees = 1};
  const auto traced =
      MustPathTrace(scene, {.width = 4, .height = 4, .samples_per_pixel = 16, .seed = 7});
  for (const Rgb& pixel : traced.image.pixels) EXPECT_EQ(pixel, Rgb{});
}

TEST(PathTracer, TellsItsNoise) {
  const PathTraceOptions options{.width = 24, .height = 24, .samples_per_pixel = 32, .seed = 3};
  const auto a = MustPathTrace(MakeCornell(), options);
  PathTraceOptions other = options;
  other.seed = 4;
  const auto b = MustPathTrace(MakeCornell(), other);
  const auto error = Compare(a.image, b.image);
  ASSERT_TRUE(error.ok());
  // Two pictures of standard error s differ by s * sqrt(2). Few bright samples make most of it: a
  // wide bound.
  const double expected = std::sqrt(a.noise * a.noise + b.noise * b.noise);
  EXPECT_GT(error->rmse, 0.5 * expected);
  EXPECT_LT(error->rmse, 2 * expected);
  EXPECT_GT(a.noise, 0);
  EXPECT_GT(a.rays, 24u * 24 * 32);
}

TEST(PathTracer, EndsAtTheNoiseThatIsWanted) {
  PathTraceOptions options{.width = 24, .height = 24, .samples_per_pixel = 4096, .seed = 3};
  options.target_noise = 0.1;
  const auto coarse = MustPathTrace(MakeCornell(), options);
  EXPECT_LE(coarse.noise, 0.1);
  EXPECT_GE(coarse.samples_per_pixel, 16u);
  options.target_noise = 0.05;
  const auto fine = MustPathTrace(MakeCornell(), options);
  EXPECT_LE(fine.noise, 0.05);
  EXPECT_GT(fine.samples_per_pixel, coarse.samples_per_pixel);
  EXPECT_LT(fine.samples_per_pixel, 4096u);
  options.samples_per_pixel = 32;  // ends first
  const auto cut = MustPathTrace(MakeCornell(), options);
  EXPECT_EQ(cut.samples_per_pixel, 32u);
  EXPECT_GT(cut.noise, 0.05);
}

TEST(PathTracer, PreviewsDoNotChangeThePicture) {
  PathTraceOptions options{.width = 24, .height = 20, .samples_per_pixel = 20, .seed = 8};
  const auto plain = MustPathTrace(MakeCornell(), options);
  std::vector<Image> seen;
  options.preview = {.show = [&](const Image& image) { seen.push_back(image); }, .interval_s = 0};
  const auto shown = MustPathTrace(MakeCornell(), options);
  EXPECT_EQ(shown.image.pixels, plain.image.pixels);
  ASSERT_GT(seen.size(), 3u);
  EXPECT_EQ(seen.back().pixels, plain.image.pixels);
  EXPECT_NEAR(Mean(seen.front()), Mean(plain.image), 0.3 * Mean(plain.image));
}

TEST(PathTracer, SaysWhatItCannotSee) {
  Scene scene = MakeCornell();
  EXPECT_FALSE(MissingFromReference(scene));
  scene.point_lights.push_back({.position = {0, 1, 0}, .intensity = {1, 1, 1}});
  const auto missing = MissingFromReference(scene);
  ASSERT_TRUE(missing);
  EXPECT_EQ(*missing, "the light of the point light by way of glass, mirror");
  scene.spheres.clear();  // the materials are there, but nothing is made of them
  EXPECT_FALSE(MissingFromReference(scene));
  scene.materials[0].surface = Surface::kPane;
  scene.point_lights.push_back(scene.point_lights[0]);
  EXPECT_EQ(MissingFromReference(scene), "the light of 2 point lights by way of white");
}

TEST(PathTracer, GivesTheSamePictureForAnyNumberOfThreads) {
  std::vector<Image> images;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    images.push_back(
        MustPathTrace(MakeCornell(), {.width = 40, .height = 30, .samples_per_pixel = 5, .seed = 5})
            .image);
  }
  for (const Image& image : images) EXPECT_EQ(image.pixels, images[0].pixels);
}

TEST(PathTracer, RefusesOptionsOutOfRange) {
  const Intersector scene = MustIntersect(MakeCornell());
  EXPECT_EQ(PathTrace(scene, {.width = 0}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(PathTrace(scene, {.samples_per_pixel = 1}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(CameraRays, SpanTheFieldOfView) {
  const Camera camera{.position = {0, 1, 5}, .target = {0, 1, 0}, .vertical_fov_degrees = 90};
  const CameraRays rays(camera, 200, 100);
  EXPECT_NEAR(Length(rays.Through(100, 50).direction - Vec3{0, 0, -1}), 0, 1e-6);
  const Vec3 top = rays.Through(100, 0).direction, left = rays.Through(0, 50).direction;
  EXPECT_NEAR(top.y / -top.z, 1, 1e-5);  // tan 45 degrees, upwards
  EXPECT_NEAR(left.x / -left.z, -2, 1e-5);
  EXPECT_EQ(rays.Through(0, 0).origin, camera.position);
}

TEST(CameraRays, JitterFillsTheCells) {
  for (std::uint32_t sample = 0; sample < 4; ++sample) {
    const auto [x, y] = JitterInPixel(sample, 5, 0.5f, 0.5f);
    EXPECT_EQ(x, sample % 2 == 0 ? 0.25f : 0.75f);
    EXPECT_EQ(y, sample / 2 == 0 ? 0.25f : 0.75f);
  }
  const auto [x, y] = JitterInPixel(4, 5, 0.1f, 0.9f);
  EXPECT_EQ(x, 0.1f);
  EXPECT_EQ(y, 0.9f);
}

}  // namespace
}  // namespace treelight::client
