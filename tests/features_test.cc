#include "client/render/features.h"

#include <cmath>

#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeClosedBox;
using ::treelight::testing::MakeLampOverFloor;
using ::treelight::testing::MustIntersect;

/// A wall of `wall` at z = 0 that fills the picture, seen from z = 2; something may stand between.
Scene MakeWall(const Material& wall) {
  Scene scene;
  scene.materials = {wall};
  AddQuad({-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}, 0, scene.mesh);
  scene.camera = {.position = {0, 0, 2}, .target = {0, 0, 0}, .vertical_fov_degrees = 20};
  return scene;
}

void ExpectNear(const Rgb& a, const Rgb& b, float tolerance) {
  EXPECT_NEAR(a.r, b.r, tolerance);
  EXPECT_NEAR(a.g, b.g, tolerance);
  EXPECT_NEAR(a.b, b.b, tolerance);
}

TEST(Features, AreThoseOfTheSurface) {
  const Rgb diffuse{0.5f, 0.3f, 0.1f}, specular{0.1f, 0.2f, 0.3f};
  for (const Material& wall :
       {Material{.name = "a", .reflectance = diffuse + specular}, Material{.name = "b",
                                                                  .surface = Surface::kGlossy,
                                                                  .reflectance = diffuse,
                                                                  .specular = specular,
                                                                  .exponent = 10}}) {
    const auto layers = TraceFeatures(MustIntersect(MakeWall(wall)), {.width = 5, .height = 4});
    ASSERT_EQ(layers.albedo.pixels.size(), 20u);
    for (int i = 0; i < 20; ++i) {
      ExpectNear(layers.albedo.pixels[i], diffuse + specular, 1e-6f);
      ExpectNear(layers.normals.pixels[i], {0, 0, 1}, 1e-6f);
    }
  }
}

TEST(Features, LampsAreWhiteAndNothingIsZero) {
  Scene scene = MakeWall({.name = "lamp", .reflectance = {}, .emission = {7, 7, 7}});
  const auto lamp = TraceFeatures(MustIntersect(scene), {.width = 2, .height = 2});
  ExpectNear(lamp.albedo.pixels[0], {1, 1, 1}, 1e-6f);
  scene.camera.target = {0, 0, 4};
  const auto nothing = TraceFeatures(MustIntersect(scene), {.width = 2, .height = 2});
  EXPECT_EQ(nothing.albedo.pixels[0], Rgb{});
  EXPECT_EQ(nothing.normals.pixels[0], Rgb{});
}

// A mirror shows the floor behind the camera; a pane lets the wall through and loses nothing, as
// what it reflects sees the same white.
TEST(Features, AreSeenThroughMirrorsGlassAndPanes) {
  Scene mirror =
      MakeWall({.name = "mirror", .surface = Surface::kMirror, .reflectance = {0.5f, 1, 1}});
  mirror.materials.push_back({.name = "behind", .reflectance = {0.4f, 0.4f, 0.8f}});
  AddQuad({9, -9, 5}, {-9, -9, 5}, {-9, 9, 5}, {9, 9, 5}, 1, mirror.mesh);
  const auto seen = TraceFeatures(MustIntersect(mirror), {.width = 2, .height = 2});
  ExpectNear(seen.albedo.pixels[0], {0.2f, 0.4f, 0.8f}, 1e-6f);
  ExpectNear(seen.normals.pixels[0], {0, 0, -1}, 1e-6f);

  for (const Surface surface : {Surface::kPane, Surface::kDielectric}) {
    Scene scene = MakeClosedBox({.name = "white", .reflectance = {0.6f, 0.6f, 0.6f}});
    scene.materials.push_back(
        {.name = "clear", .surface = surface, .reflectance = {}, .ior = 1.5f});
    scene.spheres = {{.center = {0.5f, 0.5f, 0.5f}, .radius = 0.3f, .material = 1}};
    const auto layers =
        TraceFeatures(MustIntersect(scene), {.width = 8, .height = 8, .samples_per_pixel = 64});
    double mean = 0;
    for (const Rgb& pixel : layers.albedo.pixels) mean += pixel.g / 64;
    EXPECT_NEAR(mean, 0.6, 0.005);
  }
}

TEST(Features, AreTheSameForAnyNumberOfThreads) {
  const Intersector scene = MustIntersect(MakeCornell());
  std::vector<FeatureLayers> layers;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    layers.push_back(TraceFeatures(scene, {.width = 33, .height = 21}));
  }
  for (const FeatureLayers& l : layers) {
    EXPECT_EQ(l.albedo.pixels, layers[0].albedo.pixels);
    EXPECT_EQ(l.normals.pixels, layers[0].normals.pixels);
  }
}

}  // namespace
}  // namespace treelight::client
