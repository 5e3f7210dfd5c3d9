#include "client/render/camera_pass.h"

#include <algorithm>
#include <cmath>

#include "client/scenes/vector.h"
#include "gtest/gtest.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MustIntersect;

constexpr float kRadiance = 10, kReflectance = 0.8f, kDepth = 0.01f, kWidth = 0.5f;

/// A wall that the camera sees `kDepth` below a long lamp which meets it at right angles, and a
/// larger lamp that shines away, so that the near one is seldom drawn.
Scene MakeWallUnderLamp() {
  Scene scene;
  scene.materials = {
      {.name = "wall", .reflectance = {kReflectance, kReflectance, kReflectance}},
      {.name = "lamp", .reflectance = {}, .emission = {kRadiance, kRadiance, kRadiance}}};
  AddQuad({0, 0, 50}, {0, 0, -50}, {0, 1, -50}, {0, 1, 50}, 0, scene.mesh);            // +x
  AddQuad({0, 1, -50}, {kWidth, 1, -50}, {kWidth, 1, 50}, {0, 1, 50}, 1, scene.mesh);  // -y
  AddQuad({-9, 2, 50}, {9, 2, 50}, {9, 2, -50}, {-9, 2, -50}, 1, scene.mesh);          // +y
  scene.camera = {.position = {0.4f, 1 - kDepth, 0},
                  .target = {0, 1 - kDepth, 0},
                  .vertical_fov_degrees = 0.01f};
  return scene;
}

// Of a long strip of width w, at right angles to the wall and touching it, a point at depth h sees
// the form factor (1 - h / sqrt(h^2 + w^2)) / 2. No sample is much brighter than the lamp: shadow
// rays alone gave some a thousand times as bright.
TEST(CameraPass, NextToALampTheDirectLightHasNoBrightSpecks) {
  const Intersector scene = MustIntersect(MakeWallUnderLamp());
  const Lights lights(scene.scene());
  const double expected = kReflectance * kRadiance * (1 - kDepth / std::hypot(kDepth, kWidth)) / 2;
  constexpr int kSide = 16;
  for (const std::uint32_t gather_rays : {0u, 1u, 4u}) {
    const CameraPassOptions options{.samples_per_pixel = 256, .final_gather_rays = gather_rays};
    const SampleOrder order(kSide, kSide, options.samples_per_pixel);
    const auto batch =
        TraceCameraBatch(scene, lights, CameraRays(scene.scene().camera, kSide, kSide), order, 0,
                         order.size(), options);
    double sum = 0;
    float largest = 0;
    for (const Rgb& radiance : batch.radiance) {
      sum += radiance.g;
      largest = std::max(largest, radiance.g);
    }
    EXPECT_NEAR(sum / static_cast<double>(order.size()), expected, 0.02 * expected) << gather_rays;
    EXPECT_LT(largest, 10 * kRadiance) << gather_rays;
  }
}

// A lamp fills the left half of the one pixel.
TEST(CameraPass, SamplesOfTheSameQuartersSeeTheSameSideOfAnEdge) {
  Scene scene;
  scene.materials = {{.name = "lamp", .reflectance = {}, .emission = {1, 1, 1}}};
  AddQuad({-9, -9, -1}, {0, -9, -1}, {0, 9, -1}, {-9, 9, -1}, 0, scene.mesh);
  scene.camera = {.position = {0, 0, 0}, .target = {0, 0, -1}, .vertical_fov_degrees = 40};
  const Intersector intersector = MustIntersect(scene);
  const Lights lights(intersector.scene());
  const SampleOrder order(1, 1, 1);
  const auto sees_lamp = [&](std::uint64_t seed, std::optional<std::uint64_t> quarter_seed) {
    CameraPassOptions options{.samples_per_pixel = 1, .seed = seed, .quarter_seed = quarter_seed};
    const CameraRays rays(intersector.scene().camera, 1, 1);
    return TraceCameraBatch(intersector, lights, rays, order, 0, 1, options).radiance[0].g > 0;
  };
  constexpr int kSeeds = 400;
  int left = 0, anywhere = 0;
  for (int i = 0; i < kSeeds; ++i) {
    const bool first = sees_lamp(1, i);
    left += first;
    EXPECT_EQ(sees_lamp(i, i), first) << i;
    anywhere += sees_lamp(i, std::nullopt);
  }
  EXPECT_NEAR(left, kSeeds / 2, 50);  // five standard deviations
  EXPECT_NEAR(anywhere, kSeeds / 2, 50);
}

// On the axis of a glass sphere, between a lamp behind the camera and the dark: reflectances are
// those of a slab, R = 0.04 at each side, and R + (1 - R)^2 R / (1 - R^2) of both together. The
// reflection at the far side is one of 4 %, which every sample has to have: by chance it would be
// one sample in 25 that is as bright as the lamp.
TEST(CameraPass, ALampSeenByAReflectionWithinGlassHasNoBrightSpecks) {
  Scene scene;
  scene.materials = {
      {.name = "lamp", .reflectance = {}, .emission = {kRadiance, kRadiance, kRadiance}},
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f}};
  AddQuad({-9, -9, 6}, {-9, 9, 6}, {9, 9, 6}, {9, -9, 6}, 0, scene.mesh);  // -z
  scene.spheres = {{.center = {0, 0, 0}, .radius = 1, .material = 1}};
  scene.camera = {.position = {0, 0, 5}, .target = {0, 0, 0}, .vertical_fov_degrees = 0.1f};
  const Intersector intersector = MustIntersect(scene);
  constexpr int kSide = 64;
  const SampleOrder order(kSide, kSide, 1);
  const auto batch = TraceCameraBatch(intersector, Lights(intersector.scene()),
                                      CameraRays(intersector.scene().camera, kSide, kSide), order,
                                      0, order.size(), {.samples_per_pixel = 1});
  double sum = 0;
  for (const Rgb& radiance : batch.radiance) {
    sum += radiance.g;
    EXPECT_LT(radiance.g, 0.1f * kRadiance);
  }
  const double expected = kRadiance * (0.04 + 0.96 * 0.96 * 0.04 / (1 - 0.04 * 0.04));
  EXPECT_NEAR(sum / (kSide * kSide), expected, 0.01 * expected);
}

}  // namespace
}  // namespace treelight::client
