// Pictures from photon maps against path-traced ones.
#include <cmath>

#include "client/render/path_tracer.h"
#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "gtest/gtest.h"
#include "tests/photon_renders.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeClosedBox;
using ::treelight::testing::MakeDiffuseBox;
using ::treelight::testing::MakeFurnace;
using ::treelight::testing::MakeLampOverFloor;
using ::treelight::testing::MustIntersect;

class PhotonRendererAgreementTest : public ::treelight::testing::PhotonRenders {};

constexpr int kSide = 16;

TEST_F(PhotonRendererAgreementTest, AgreesWithThePathTracerInADiffuseBox) {
  const Intersector scene = MustIntersect(MakeDiffuseBox());
  const auto reference =
      PathTrace(scene, {.width = kSide, .height = kSide, .samples_per_pixel = 400, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto maps = MustUpload(scene, 60'000);
  EXPECT_FALSE(maps.caustic);
  constexpr EstimateOptions kEstimate{.k = 100, .radius = 0.07f};
  const auto render = MustRender(scene, maps.refs(),
                                 {.width = kSide,
                                  .height = kSide,
                                  .camera = {.samples_per_pixel = 16},
                                  .indirect = kEstimate});
  const auto error = Compare(render.image, reference->image);
  ASSERT_TRUE(error.ok());
  EXPECT_NEAR(error->mean_ratio, 1, 0.02);
  EXPECT_LT(error->relative_mse, 0.02);
  EXPECT_EQ(render.indirect.queries, 16u * kSide * kSide);
  EXPECT_EQ(render.caustic.queries, 0u);
  const auto traversal =
      GatherSample(*client_, *maps.refs().indirect, kEstimate, render.indirect.sample);
  ASSERT_TRUE(traversal.ok()) << traversal.status();
  EXPECT_EQ(traversal->tests_per_query, maps.indirect->map().photon_count());  // brute force
}

// Mirror and glass, seen directly and as caustics.
TEST_F(PhotonRendererAgreementTest, AgreesWithThePathTracerInCornell) {
  const Intersector scene = MustIntersect(MakeCornell());
  const auto reference =
      PathTrace(scene, {.width = kSide, .height = kSide, .samples_per_pixel = 6000, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto maps = MustUpload(scene, 30'000);
  const auto render = MustRender(
      scene, maps.refs(), {.width = kSide, .height = kSide, .camera = {.samples_per_pixel = 36}});
  const auto error = Compare(render.image, reference->image);
  ASSERT_TRUE(error.ok());
  EXPECT_NEAR(error->mean_ratio, 1, 0.02);
  EXPECT_LT(error->relative_mse, 0.02);
}

// Final gathering looks the same light up elsewhere, in corners after another bounce.
TEST_F(PhotonRendererAgreementTest, FinalGatheringAgreesWithThePathTracerInCornell) {
  const Intersector scene = MustIntersect(MakeCornell());
  const auto reference =
      PathTrace(scene, {.width = kSide, .height = kSide, .samples_per_pixel = 6000, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto maps = MustUpload(scene, 60'000);
  for (const float min_distance : {0.0f, 0.2f}) {
    const auto render = MustRender(scene, maps.refs(),
                                   {.width = kSide,
                                    .height = kSide,
                                    .camera = {.samples_per_pixel = 36,  // for the rim of the lamp
                                               .final_gather_rays = 2,
                                               .final_gather_min_distance = min_distance}});
    const auto error = Compare(render.image, reference->image);
    ASSERT_TRUE(error.ok());
    EXPECT_NEAR(error->mean_ratio, 1, 0.02) << min_distance;
    EXPECT_LT(error->relative_mse, 0.02) << min_distance;
  }
}

/// A box with 64 small lamps in its ceiling, each with a white flap close beside it.
Scene MakeBoxOfManyLamps() {
  Scene scene = MakeClosedBox({.name = "grey", .reflectance = {0.1f, 0.1f, 0.1f}});
  scene.materials.push_back({.name = "lamp", .reflectance = {}, .emission = {30, 30, 30}});
  scene.materials.push_back({.name = "flap", .reflectance = {0.9f, 0.9f, 0.9f}});
  for (int i = 0; i < 64; ++i) {
    const float x = 0.08f + 0.12f * static_cast<float>(i % 8),
                z = 0.08f + 0.12f * static_cast<float>(i / 8), w = x + 0.04f, d = z + 0.04f;
    AddQuad({x, 0.98f, z}, {w, 0.98f, z}, {w, 0.98f, d}, {x, 0.98f, d}, 1, scene.mesh);
    AddQuad({w, 0.98f, z}, {w, 0.9f, z}, {w, 0.9f, d}, {w, 0.98f, d}, 2, scene.mesh);
    AddQuad({w, 0.98f, d}, {w, 0.9f, d}, {w, 0.9f, z}, {w, 0.98f, z}, 2, scene.mesh);
  }
  scene.camera = {
      .position = {0.5f, 0.5f, 0.95f}, .target = {0.5f, 0.2f, 0}, .vertical_fov_degrees = 40};
  return scene;
}

// A flap is lit by its own lamp, which one shadow ray in 64 finds: gather rays that end there made
// specks.
TEST_F(PhotonRendererAgreementTest, FinalGatheringAgreesWithThePathTracerUnderManyLamps) {
  const Intersector scene = MustIntersect(MakeBoxOfManyLamps());
  const auto reference =
      PathTrace(scene, {.width = kSide, .height = kSide, .samples_per_pixel = 3000, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto maps = MustUpload(scene, 60'000);
  const auto render =
      MustRender(scene, maps.refs(),
                 {.width = kSide,
                  .height = kSide,
                  .camera = {.samples_per_pixel = 4, .light_strata = 16, .final_gather_rays = 8},
                  .indirect = {.k = 0, .radius = 0.04f}});
  const auto error = Compare(render.image, reference->image);
  ASSERT_TRUE(error.ok());
  EXPECT_NEAR(error->mean_ratio, 1, 0.03);  // flaps and ceiling are in one sphere
  EXPECT_LT(error->relative_mse, 0.04);
}

/// A box with all that scatters: a glossy floor, a mirror sphere, a pane in the middle.
Scene MakeMixedBox() {
  Scene scene = MakeDiffuseBox();
  scene.materials[0] = {.name = "glossy",
                        .surface = Surface::kGlossy,
                        .reflectance = {0.4f, 0.4f, 0.3f},
                        .specular = {0.4f, 0.3f, 0.4f},
                        .exponent = 20};
  scene.materials.push_back(
      {.name = "mirror", .surface = Surface::kMirror, .reflectance = {0.9f, 0.9f, 0.9f}});
  scene.materials.push_back({.name = "pane",
                             .surface = Surface::kPane,
                             .reflectance = {},
                             .ior = 1.5f,
                             .transmittance = {0.9f, 0.8f, 0.9f}});
  scene.spheres = {{.center = {0.75f, 0.2f, 0.3f}, .radius = 0.15f, .material = 2}};
  AddQuad({0.2f, 0.5f, 0.2f}, {0.2f, 0.5f, 0.8f}, {0.8f, 0.5f, 0.8f}, {0.8f, 0.5f, 0.2f}, 3,
          scene.mesh);
  return scene;
}

TEST_F(PhotonRendererAgreementTest, AgreesWithThePathTracerOnLobesMirrorsAndPanes) {
  const Intersector scene = MustIntersect(MakeMixedBox());
  const auto reference =
      PathTrace(scene, {.width = kSide, .height = kSide, .samples_per_pixel = 1500, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto maps = MustUpload(scene, 25'000);
  ASSERT_TRUE(maps.caustic);
  for (const std::uint32_t gather_rays : {0, 2}) {
    const auto render =
        MustRender(scene, maps.refs(),
                   {.width = kSide,
                    .height = kSide,
                    .camera = {.samples_per_pixel = 16, .final_gather_rays = gather_rays},
                    .indirect = {.k = 0, .radius = 0.06f},
                    .caustic = {.k = 0, .radius = 0.06f}});
    const auto error = Compare(render.image, reference->image);
    ASSERT_TRUE(error.ok());
    EXPECT_NEAR(error->mean_ratio, 1, 0.02) << gather_rays;
    EXPECT_LT(error->relative_mse, 0.02) << gather_rays;
  }
}

// A lamp behind a pane is sampled and met by the lobe, and counted once.
TEST_F(PhotonRendererAgreementTest, LobesSeeLampsThroughPanesOnce) {
  Scene scene = MakeLampOverFloor(5, 3);
  scene.materials[0] = {.name = "floor",
                        .surface = Surface::kGlossy,
                        .reflectance = {},
                        .specular = {0.8f, 0.8f, 0.8f},
                        .exponent = 30};
  scene.materials.push_back(
      {.name = "pane", .surface = Surface::kPane, .reflectance = {}, .ior = 1.5f});
  AddQuad({-9, 0.6f, 9}, {9, 0.6f, 9}, {9, 0.6f, -9}, {-9, 0.6f, -9}, 2, scene.mesh);
  scene.camera = {.position = {0.6f, 0.3f, 0}, .target = {0.3f, 0, 0}, .vertical_fov_degrees = 20};
  const Intersector intersector = MustIntersect(scene);
  const auto reference = PathTrace(
      intersector, {.width = kSide, .height = kSide, .samples_per_pixel = 600, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  // No photons: what light there is comes by way of lobes and panes alone.
  const auto render = MustRender(
      intersector, {}, {.width = kSide, .height = kSide, .camera = {.samples_per_pixel = 64}});
  const auto error = Compare(render.image, reference->image);
  ASSERT_TRUE(error.ok());
  EXPECT_NEAR(error->mean_ratio, 1, 0.01);
  EXPECT_LT(error->relative_mse, 0.01);
}

// A floor under water: photons reach it through one boundary, the eye sees it through the same one.
// Where paths forget that radiance is n^2 as large in water, the two differ by that.
TEST_F(PhotonRendererAgreementTest, AgreesWithThePathTracerUnderWater) {
  Scene scene = MakeLampOverFloor(5, 1);
  scene.materials.push_back(
      {.name = "water", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.33f});
  AddQuad({-30, 0.1f, 30}, {30, 0.1f, 30}, {30, 0.1f, -30}, {-30, 0.1f, -30},
          static_cast<std::uint32_t>(scene.materials.size() - 1), scene.mesh);
  scene.camera = {.position = {0.4f, 0.7f, 0}, .target = {0.3f, 0, 0}, .vertical_fov_degrees = 60};
  const Intersector intersector = MustIntersect(scene);
  const auto reference = PathTrace(
      intersector, {.width = kSide, .height = kSide, .samples_per_pixel = 3000, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto maps = MustUpload(intersector, 200'000);
  ASSERT_TRUE(maps.caustic);
  for (const std::uint32_t gather_rays : {0, 2}) {
    const auto render =
        MustRender(intersector, maps.refs(),
                   {.width = kSide,
                    .height = kSide,
                    .camera = {.samples_per_pixel = 16, .final_gather_rays = gather_rays},
                    .indirect = {.k = 0, .radius = 0.1f},
                    .caustic = {.k = 0, .radius = 0.1f}});
    const auto error = Compare(render.image, reference->image);
    ASSERT_TRUE(error.ok());
    EXPECT_NEAR(error->mean_ratio, 1, 0.03) << gather_rays;
    EXPECT_LT(error->relative_mse, 0.02) << gather_rays;
  }
}

// Lobes are lit by point lights through shadow rays, also behind a pane.
TEST_F(PhotonRendererAgreementTest, AgreesWithThePathTracerOnPointLights) {
  Scene box = MakeMixedBox();
  box.spheres.clear();
  for (const int material : {1, 3}) box.materials[material] = box.materials[0];
  box.point_lights = {{.position = {0.5f, 0.8f, 0.5f}, .intensity = {1, 1, 1}}};
  ASSERT_FALSE(MissingFromReference(box));
  const Intersector scene = MustIntersect(box);
  const auto reference =
      PathTrace(scene, {.width = kSide, .height = kSide, .samples_per_pixel = 1000, .seed = 1});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto maps = MustUpload(scene, 25'000);
  const auto render = MustRender(scene, maps.refs(),
                                 {.width = kSide,
                                  .height = kSide,
                                  .camera = {.samples_per_pixel = 16, .final_gather_rays = 2},
                                  .indirect = {.k = 0, .radius = 0.06f},
                                  .caustic = {.k = 0, .radius = 0.06f}});
  const auto error = Compare(render.image, reference->image);
  ASSERT_TRUE(error.ok());
  EXPECT_NEAR(error->mean_ratio, 1, 0.02);
  EXPECT_LT(error->relative_mse, 0.02);
}

// A lobe that takes light from the Lambertian part, and loses some at grazing angles, stays between
// the furnace without it and the one that reflects all of it.
TEST_F(PhotonRendererAgreementTest, GlossyFurnaceStaysInItsBounds) {
  Scene furnace = MakeFurnace(0.3f, 2);
  furnace.materials[0].surface = Surface::kGlossy;
  furnace.materials[0].specular = {0.3f, 0.3f, 0.3f};
  furnace.materials[0].exponent = 50;
  furnace.camera.vertical_fov_degrees = 25;
  const Intersector scene = MustIntersect(furnace);
  const auto maps = MustUpload(scene, 100'000);
  const auto render = MustRender(scene, maps.refs(),
                                 {.width = 8,
                                  .height = 8,
                                  .camera = {.samples_per_pixel = 16},
                                  .indirect = {.k = 0, .radius = 0.1f},
                                  .caustic = {.k = 0, .radius = 0.1f}});
  double mean = 0;
  for (const Rgb& pixel : render.image.pixels) mean += pixel.g / 64;
  EXPECT_GT(mean, 2 / (1 - 0.3));
  EXPECT_LT(mean, 1.005 * 2 / (1 - 0.6));
  const auto reference =
      PathTrace(scene, {.width = 8, .height = 8, .samples_per_pixel = 2000, .seed = 2});
  ASSERT_TRUE(reference.ok());
  const auto error = Compare(render.image, reference->image);
  EXPECT_NEAR(error->mean_ratio, 1, 0.01);
}

}  // namespace
}  // namespace treelight::client
