#include "client/render/photon_renderer.h"

#include <cmath>
#include <numbers>

#include "client/render/map_upload.h"
#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "client/trace/photon_tracer.h"
#include "core/builder.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/photon_renders.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeDiffuseBox;
using ::treelight::testing::MakeFurnace;
using ::treelight::testing::MakeLampOverFloor;
using ::treelight::testing::MakeLampUnderMirror;
using ::treelight::testing::MustIntersect;

class PhotonRendererTest : public ::treelight::testing::PhotonRenders {};

constexpr int kSide = 16;

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

}  // namespace
}  // namespace treelight::client
