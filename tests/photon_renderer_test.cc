#include "client/render/photon_renderer.h"

#include <cmath>
#include <numbers>

#include "client/render/gather_radius.h"
#include "client/render/map_upload.h"
#include "client/render/path_tracer.h"
#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "client/trace/photon_tracer.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/server_fixture.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeDiffuseBox;
using ::treelight::testing::MakeFurnace;
using ::treelight::testing::MakeLampOverFloor;
using ::treelight::testing::MakeLampUnderMirror;
using ::treelight::testing::MustIntersect;

/// Pictures by way of a whole server, in process, on the brute-force builder.
class PhotonRendererTest : public ::treelight::testing::ServerTest {
 protected:
  void SetUp() override {
    Start();
    ASSERT_NE(server_, nullptr);
    client_.emplace(server_->InProcessChannel());
  }
  void TearDown() override { client_.reset(); }

  UploadedMaps MustUpload(const Intersector& scene, std::uint64_t photon_count,
                          std::uint64_t seed = 11) {
    const auto photons = TracePhotons(
        scene,
        {.indirect_photons = photon_count, .caustic_photons = photon_count / 4, .seed = seed});
    EXPECT_TRUE(photons.ok()) << photons.status();
    auto maps = UploadMaps(*client_, *photons, {.name = "test"});
    EXPECT_TRUE(maps.ok()) << maps.status();
    return *std::move(maps);
  }

  PhotonRenderedImage MustRender(const Intersector& scene, const PhotonMaps& maps,
                                 const PhotonRenderOptions& options) {
    auto render = RenderPhotonMaps(scene, *client_, maps, options);
    EXPECT_TRUE(render.ok()) << render.status();
    return *std::move(render);
  }

  std::optional<PhotonMapClient> client_;
};

constexpr int kSide = 16;

TEST_F(PhotonRendererTest, AgreesWithThePathTracerInADiffuseBox) {
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
TEST_F(PhotonRendererTest, AgreesWithThePathTracerInCornell) {
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
TEST_F(PhotonRendererTest, FinalGatheringAgreesWithThePathTracerInCornell) {
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

TEST_F(PhotonRendererTest, AgreesWithThePathTracerOnLobesMirrorsAndPanes) {
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
TEST_F(PhotonRendererTest, LobesSeeLampsThroughPanesOnce) {
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
TEST_F(PhotonRendererTest, AgreesWithThePathTracerUnderWater) {
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
TEST_F(PhotonRendererTest, AgreesWithThePathTracerOnPointLights) {
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

// In a closed box whose walls emit E and reflect rho the radiance is E / (1 - rho) everywhere.
TEST_F(PhotonRendererTest, FurnaceHasTheAnalyticRadiance) {
  constexpr float kRho = 0.5f, kEmission = 2;
  Scene furnace = MakeFurnace(kRho, kEmission);
  furnace.camera.vertical_fov_degrees = 25;  // away from edges, beyond which there are no photons
  const Intersector scene = MustIntersect(furnace);
  const auto maps = MustUpload(scene, 100'000);
  for (const DensityKernel kernel :
       {DensityKernel::kConstant, DensityKernel::kCone, DensityKernel::kEpanechnikov}) {
    for (const std::uint32_t gather_rays : {0, 8}) {
      const auto render = MustRender(
          scene, maps.refs(),
          {.width = 8,
           .height = 8,
           .camera = {.samples_per_pixel = 4, .light_strata = 8, .final_gather_rays = gather_rays},
           .indirect = {.k = 0, .radius = 0.05f, .kernel = kernel}});
      constexpr double kExpected = kEmission / (1 - kRho);
      double mean = 0;
      for (const Rgb& pixel : render.image.pixels) {
        mean += pixel.g / 64;
        // 130 photons a gather: 9 % of the half that they bring. Gather rays that end in corners,
        // where a light is near, are noisier.
        if (gather_rays == 0) {
          EXPECT_NEAR(pixel.g, kExpected, 0.2 * kExpected);
        }
      }
      EXPECT_NEAR(mean, kExpected, 0.02 * kExpected) << gather_rays;
    }
  }
}

// A lobe that takes light from the Lambertian part, and loses some at grazing angles, stays between
// the furnace without it and the one that reflects all of it.
TEST_F(PhotonRendererTest, GlossyFurnaceStaysInItsBounds) {
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

TEST_F(PhotonRendererTest, GivesTheSamePictureForAnyNumberOfThreads) {
  const Intersector scene = MustIntersect(MakeCornell());
  for (const std::uint32_t gather_rays : {0, 3}) {
    const auto maps = MustUpload(scene, 2'000);
    std::vector<Image> images;
    for (const std::size_t threads : {1, 2, 8}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      images.push_back(MustRender(scene, maps.refs(),
                                  {.width = 33,
                                   .height = 21,
                                   .camera = {.final_gather_rays = gather_rays,
                                              .final_gather_min_distance = 0.1f}})
                           .image);
    }
    for (const Image& image : images) EXPECT_EQ(image.pixels, images[0].pixels);
  }
}

// The floor below a small lamp, direct light alone: E = L A cos cos' / d^2, seen as rho / pi E.
TEST_F(PhotonRendererTest, DirectLightHasTheAnalyticRadiance) {
  constexpr float kLampSide = 0.05f, kRadiance = 100;
  const Intersector scene = MustIntersect(MakeLampOverFloor(kRadiance, kLampSide));
  const auto render = MustRender(scene, {}, {.width = 4, .height = 4});
  const double expected = 0.5 / std::numbers::pi * kRadiance * kLampSide * kLampSide;
  for (const Rgb& pixel : render.image.pixels) EXPECT_NEAR(pixel.g, expected, 0.01 * expected);
}

// The floor under a small light that reaches it as photons alone, by way of a mirror, so that it
// seems to hang at (0, 3, 0): E = L A cos cos' / d^2 = 9 L A / d^4.
TEST_F(PhotonRendererTest, CausticsHaveTheAnalyticRadiance) {
  constexpr float kLampSide = 0.1f, kRadiance = 50;
  constexpr int kWidth = 4;
  const Intersector scene = MustIntersect(MakeLampUnderMirror(kRadiance, kLampSide));
  const auto photons =
      TracePhotons(scene, {.indirect_photons = 0, .caustic_photons = 1'000'000, .seed = 1});
  ASSERT_TRUE(photons.ok()) << photons.status();
  const auto maps = UploadMaps(*client_, *photons, {.name = "test"});
  ASSERT_TRUE(maps.ok()) << maps.status();
  const auto render =
      MustRender(scene, maps->refs(),
                 {.width = kWidth, .height = kWidth, .caustic = {.k = 0, .radius = 0.5f}});
  const CameraRays camera(scene.scene().camera, kWidth, kWidth);
  for (int i = 0; i < kWidth * kWidth; ++i) {
    const auto hit = scene.Intersect(camera.Through(i % kWidth + 0.5f, i / kWidth + 0.5f));
    ASSERT_TRUE(hit);
    const Vec3 path = hit->position - Vec3{0, 3, 0};
    const double irradiance = 9 * kRadiance * kLampSide * kLampSide / std::pow(Dot(path, path), 2);
    const double expected = 0.5 / std::numbers::pi * irradiance;
    EXPECT_NEAR(render.image.pixels[i].g, expected, 0.02 * expected) << i;
  }
}

// Several messages of both maps on their way at once: a glass sphere fills the picture and splits
// the rays.
TEST_F(PhotonRendererTest, AnswersComeTogetherInOrder) {
  Scene glass = MakeDiffuseBox();
  glass.materials.push_back(
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f});
  glass.spheres = {{.center = {0.5f, 0.5f, 0.4f}, .radius = 0.35f, .material = 2}};
  glass.camera.vertical_fov_degrees = 20;
  const Intersector scene = MustIntersect(glass);
  const auto photons =
      TracePhotons(scene, {.indirect_photons = 30, .caustic_photons = 10, .seed = 12});
  ASSERT_TRUE(photons.ok()) << photons.status();
  ASSERT_GT(photons->caustic.size(), 0u);
  const auto maps = UploadMaps(*client_, *photons, {.name = "test"});
  ASSERT_TRUE(maps.ok()) << maps.status();
  PhotonRenderOptions options{
      .width = 200, .height = 170, .camera = {.samples_per_pixel = 2, .light_strata = 1}};
  options.indirect = {.k = 0, .radius = 10, .kernel = DensityKernel::kCone};
  options.caustic = {.k = 0, .radius = 8, .kernel = DensityKernel::kConstant};
  std::uint64_t samples = 0;
  options.progress = [&](std::uint64_t done) {
    EXPECT_GE(done, samples);
    samples = done;
  };
  for (const std::uint32_t gather_rays : {0, 1}) {
    options.camera.final_gather_rays = gather_rays;
    samples = 0;
    const auto render = MustRender(scene, maps->refs(), options);
    EXPECT_EQ(samples, 2u * 200 * 170);

    // The same in one piece, without a server.
    const Lights lights(scene.scene());
    const SampleOrder order(200, 170, 2);
    const CameraBatch batch =
        TraceCameraBatch(scene, lights, CameraRays(scene.scene().camera, 200, 170), order, 0,
                         order.size(), options.camera);
    EXPECT_GT(render.indirect.messages, MapGather::kMaxInFlight);
    EXPECT_GT(render.caustic.messages, MapGather::kMaxInFlight);
    std::vector<Rgb> radiance = batch.radiance;
    std::uint64_t queries = 0;
    const auto add = [&](const Photons& set, const EstimateOptions& estimate,
                         const GatherPoints& points) {
      const auto map = MakeBruteForceBuilder()->Build(set, {});
      ASSERT_TRUE(map.ok());
      const auto gathered =
          (*map)->Gather({.positions = points.positions, .normals = points.normals, .radii = {}},
                         {.k = 0,
                          .radius = estimate.radius,
                          .outputs = kOutputDensity,
                          .kernel = estimate.kernel});
      ASSERT_TRUE(gathered.ok()) << gathered.status();
      for (std::size_t i = 0; i < points.size(); ++i) {
        const float* density = &gathered->densities[3 * i];
        radiance[points.samples[i]] += points.weights[i] * Rgb{density[0], density[1], density[2]};
      }
      queries += points.size();
    };
    add(photons->indirect, options.indirect,
        gather_rays > 0 ? batch.final_gather : batch.diffuse_hits);
    EXPECT_EQ(render.indirect.queries, queries);
    add(photons->caustic, options.caustic, batch.diffuse_hits);
    add(photons->caustic, options.caustic, batch.gather_caustics);
    EXPECT_EQ(render.indirect.queries + render.caustic.queries, queries);
    ProgressiveImage expected(200, 170);
    for (std::uint64_t i = 0; i < order.size(); ++i) expected.Add(order.At(i).pixel, radiance[i]);
    const Image mean = expected.Mean();
    for (std::size_t i = 0; i < mean.pixels.size(); ++i) {
      // The same sums in another order: the maps take turns.
      const Rgb &a = render.image.pixels[i], &b = mean.pixels[i];
      ASSERT_NEAR(a.r, b.r, 1e-5 * b.r) << i;
      ASSERT_NEAR(a.g, b.g, 1e-5 * b.g) << i;
      ASSERT_NEAR(a.b, b.b, 1e-5 * b.b) << i;
    }
  }
}

// The server's limits decide how large a message is.
TEST_F(PhotonRendererTest, MessagesKeepToTheLimitsOfTheServer) {
  client_.reset();
  server_.reset();
  options_.limits.max_queries = 100;
  Start();
  client_.emplace(server_->InProcessChannel());
  const Intersector scene = MustIntersect(MakeDiffuseBox());
  const auto maps = MustUpload(scene, 200);
  const auto render = MustRender(scene, maps.refs(),
                                 {.width = 30, .height = 20, .camera = {.samples_per_pixel = 1}});
  EXPECT_EQ(render.indirect.queries, 600u);
  EXPECT_EQ(render.indirect.messages, 6u);
}

TEST_F(PhotonRendererTest, PreviewsAreWholePicturesAndChangeNothing) {
  const Intersector scene = MustIntersect(MakeCornell());
  const auto maps = MustUpload(scene, 500);
  PhotonRenderOptions options{.width = 64, .height = 64, .camera = {.samples_per_pixel = 8}};
  const auto plain = MustRender(scene, maps.refs(), options);
  std::vector<Image> seen;
  options.preview = {.show = [&](const Image& image) { seen.push_back(image); }, .interval_s = 0};
  const auto shown = MustRender(scene, maps.refs(), options);
  EXPECT_EQ(shown.image.pixels, plain.image.pixels);
  ASSERT_GE(seen.size(), 2u);
  EXPECT_EQ(seen.back().pixels, plain.image.pixels);
  // The first has direct and indirect light already.
  const auto error = Compare(seen.front(), plain.image);
  ASSERT_TRUE(error.ok());
  EXPECT_NEAR(error->mean_ratio, 1, 0.1);
}

TEST_F(PhotonRendererTest, OverlapIsWhatDoesNotFitOneAfterTheOther) {
  PhotonRenderedImage image;
  image.indirect = {.kernel_us = 6e6, .transfer_us = 1e6, .wait_s = 1};
  image.caustic = {.kernel_us = 1e6, .transfer_us = 2e6, .wait_s = 2};
  image.camera_s = 4;
  image.seconds = 11;
  EXPECT_DOUBLE_EQ(image.device_s(), 10);
  EXPECT_DOUBLE_EQ(image.wait_s(), 3);
  EXPECT_DOUBLE_EQ(image.overlap_s(), 3);
  image.seconds = 15;
  EXPECT_EQ(image.overlap_s(), 0);
}

TEST_F(PhotonRendererTest, MapsAreDeletedByVersion) {
  const Intersector scene = MustIntersect(MakeCornell());
  const auto first = MustUpload(scene, 500), second = MustUpload(scene, 500);
  EXPECT_EQ(client_->ListPhotonMaps()->size(), 4u);
  ASSERT_TRUE(DeleteMaps(*client_, first.refs()).ok());
  const auto left = client_->ListPhotonMaps();
  ASSERT_TRUE(left.ok());
  ASSERT_EQ(left->size(), 2u);
  for (const auto& map : *left) EXPECT_EQ(map.version(), 2u);
  EXPECT_EQ(DeleteMaps(*client_, first.refs()).code(), absl::StatusCode::kNotFound);
}

TEST_F(PhotonRendererTest, FailuresAreTold) {
  const Intersector scene = MustIntersect(MakeCornell());
  const auto code = [&](const PhotonMaps& maps, const PhotonRenderOptions& options) {
    return RenderPhotonMaps(scene, *client_, maps, options).status().code();
  };
  EXPECT_EQ(code({.indirect = MapRef{"none"}, .caustic = {}}, {}), absl::StatusCode::kNotFound);
  EXPECT_EQ(code({}, {.width = 0}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({}, {.indirect = {.k = 5000, .radius = 1}}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({}, {.caustic = {.k = 5, .radius = 0}}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({}, {.camera = {.samples_per_pixel = 0}}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({}, {.camera = {.samples_per_pixel = 1 << 20, .final_gather_rays = 17}}),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({}, {.camera = {.final_gather_min_distance = NAN}}),
            absl::StatusCode::kInvalidArgument);
}

/// `count` photons on the x axis, `spacing` apart.
TracedPhotons MakeLine(std::size_t count, float spacing) {
  TracedPhotons line;
  for (std::size_t i = 0; i < count; ++i) {
    line.indirect.positions.insert(line.indirect.positions.end(),
                                   {spacing * static_cast<float>(i), 0, 0});
    line.indirect.powers.insert(line.indirect.powers.end(), {1, 1, 1});
    line.indirect.directions.insert(line.indirect.directions.end(), {0, 0});
  }
  return line;
}

TEST_F(PhotonRendererTest, TheRadiusOfNearestIsAQuantileOverThePhotons) {
  const auto radius = [&](const TracedPhotons& photons, std::uint32_t k, double quantile) {
    const auto maps = UploadMaps(*client_, photons, {.name = "line"});
    EXPECT_TRUE(maps.ok()) << maps.status();
    const auto found =
        RadiusOfNearest(*client_, *maps->refs().indirect, photons.indirect, k, quantile);
    EXPECT_TRUE(found.ok()) << found.status();
    return found.value_or(-1);
  };
  // A photon is the nearest to itself; those beside it are one spacing away, but for the two ends.
  EXPECT_EQ(radius(MakeLine(100, 1), 3, 0.5), 1);
  EXPECT_EQ(radius(MakeLine(100, 1), 3, 0.98), 1);
  EXPECT_EQ(radius(MakeLine(100, 1), 3, 1), 2);
  EXPECT_EQ(radius(MakeLine(100, 8), 3, 0.5), 8);  // follows the size of the scene
  EXPECT_EQ(radius(MakeLine(100, 1), 21, 0.5), 10);
  EXPECT_EQ(radius(MakeLine(5000, 1), 3, 0.95), 1);  // more than are asked for
  EXPECT_GT(radius(MakeLine(10, 0), 3, 0.5), 0);     // all at one point
}

// Photons, map and answers do not depend on threads, so neither does a radius that comes of them.
TEST_F(PhotonRendererTest, TheRadiusOfNearestIsTheSameForAnyNumberOfThreads) {
  const Intersector scene = MustIntersect(MakeCornell());
  std::vector<float> radii;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const auto photons = TracePhotons(scene, {.indirect_photons = 20'000, .caustic_photons = 0});
    ASSERT_TRUE(photons.ok()) << photons.status();
    const auto maps = UploadMaps(*client_, *photons, {.name = "cornell"});
    ASSERT_TRUE(maps.ok()) << maps.status();
    const auto radius =
        RadiusOfNearest(*client_, *maps->refs().indirect, photons->indirect, 50, 0.95);
    ASSERT_TRUE(radius.ok()) << radius.status();
    radii.push_back(*radius);
  }
  EXPECT_GT(radii[0], 0);
  EXPECT_EQ(radii[1], radii[0]);
  EXPECT_EQ(radii[2], radii[0]);
}

}  // namespace
}  // namespace treelight::client
