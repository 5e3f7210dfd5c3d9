#include "client/render/photon_renderer.h"

#include <numbers>

#include "client/render/map_upload.h"
#include "client/render/path_tracer.h"
#include "client/scenes/cornell.h"
#include "client/trace/photon_tracer.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/server_fixture.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeDiffuseBox;
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

  UploadedMaps MustUpload(const Intersector& scene, std::uint64_t photon_count) {
    const auto photons = TracePhotons(
        scene, {.indirect_photons = photon_count, .caustic_photons = photon_count / 4, .seed = 11});
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
  const auto maps = MustUpload(scene, 30'000);
  EXPECT_FALSE(maps.caustic);
  const auto render = MustRender(scene, maps.refs(),
                                 {.width = kSide,
                                  .height = kSide,
                                  .camera = {.samples_per_pixel = 16},
                                  .indirect = {.k = 100, .radius = 0.1f}});
  const auto error = Compare(render.image, reference->image);
  ASSERT_TRUE(error.ok());
  EXPECT_NEAR(error->mean_ratio, 1, 0.02);
  EXPECT_LT(error->relative_mse, 0.02);
  EXPECT_EQ(render.indirect.queries, 16u * kSide * kSide);
  EXPECT_EQ(render.caustic.queries, 0u);
  const auto traversal = GatherSample(*client_, *maps.refs().indirect, {.k = 100, .radius = 0.1f},
                                      render.indirect.sample);
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

TEST_F(PhotonRendererTest, GivesTheSamePictureForAnyNumberOfThreads) {
  const Intersector scene = MustIntersect(MakeCornell());
  const auto maps = MustUpload(scene, 2'000);
  std::vector<Image> images;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    images.push_back(MustRender(scene, maps.refs(), {.width = 33, .height = 21}).image);
  }
  for (const Image& image : images) EXPECT_EQ(image.pixels, images[0].pixels);
}

TEST_F(PhotonRendererTest, CausticsHaveTheAnalyticRadiance) {
  constexpr float kLampSide = 0.1f, kRadiance = 50;
  const Intersector scene = MustIntersect(MakeLampUnderMirror(kRadiance, kLampSide));
  const PhotonMaps maps{.caustic = MustUpload(scene, 300'000).refs().caustic};
  const auto render =
      MustRender(scene, maps, {.width = 4, .height = 4, .caustic = {.k = 0, .radius = 0.5f}});
  const double squared_distance = 9 + 1.5 * 1.5;
  const double irradiance =
      kRadiance * kLampSide * kLampSide * 9 / (squared_distance * squared_distance);
  for (const Rgb& pixel : render.image.pixels) {
    EXPECT_NEAR(pixel.g, 0.5 / std::numbers::pi * irradiance,
                0.04 * 0.5 / std::numbers::pi * irradiance);
  }
}

// More than one camera batch, and batches of more queries than one message takes: a glass sphere
// fills the picture and splits the rays.
TEST_F(PhotonRendererTest, BatchesComeTogetherInOrder) {
  Scene glass = MakeDiffuseBox();
  glass.materials.push_back(
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f});
  glass.spheres = {{.center = {0.5f, 0.5f, 0.4f}, .radius = 0.35f, .material = 2}};
  glass.camera.vertical_fov_degrees = 20;
  const Intersector scene = MustIntersect(glass);
  const auto photons =
      TracePhotons(scene, {.indirect_photons = 20, .caustic_photons = 10, .seed = 12});
  ASSERT_TRUE(photons.ok()) << photons.status();
  const auto maps = UploadMaps(*client_, *photons, {.name = "test"});
  ASSERT_TRUE(maps.ok()) << maps.status();
  PhotonRenderOptions options{
      .width = 200, .height = 170, .camera = {.samples_per_pixel = 2, .light_strata = 1}};
  options.indirect = {.k = 0, .radius = 10};
  std::uint64_t pixels = 0;
  options.progress = [&](std::uint64_t done) {
    EXPECT_GT(done, pixels);
    pixels = done;
  };
  const auto render = MustRender(scene, {.indirect = maps->refs().indirect}, options);
  EXPECT_EQ(pixels, 200u * 170);

  // The same in one piece, without a server.
  const Lights lights(scene.scene());
  const CameraBatch batch = TraceCameraBatch(
      scene, lights, CameraRays(scene.scene().camera, 200, 170), 200, 0, 200 * 170, options.camera);
  ASSERT_GT(batch.size(), std::size_t{2} * 2 * 200 * 170);  // over 65536 of each 32768 samples
  EXPECT_EQ(render.indirect.queries, batch.size());
  const auto map = MakeBruteForceBuilder()->Build(photons->indirect, {});
  ASSERT_TRUE(map.ok());
  const auto gathered =
      (*map)->Gather({.positions = batch.positions, .normals = batch.normals, .radii = {}},
                     {.k = 0, .radius = 10, .outputs = kOutputDensity});
  ASSERT_TRUE(gathered.ok()) << gathered.status();
  std::vector<Rgb> expected = batch.radiance;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const float* density = &gathered->densities[3 * i];
    expected[batch.pixels[i]] += batch.weights[i] * Rgb{density[0], density[1], density[2]};
  }
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_EQ(render.image.pixels[i], expected[i]) << i;
  }
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
}

}  // namespace
}  // namespace treelight::client
