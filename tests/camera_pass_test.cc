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

}  // namespace
}  // namespace treelight::client
