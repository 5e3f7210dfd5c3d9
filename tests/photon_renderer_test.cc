#include "client/render/photon_renderer.h"

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
    const auto photons = TracePhotons(scene, {.photon_count = photon_count, .seed = 11});
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
  EXPECT_EQ(render.indirect.tests_per_query, maps.indirect->map().photon_count());  // brute force
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

// More than one camera batch, and a batch of more queries than one message takes.
TEST_F(PhotonRendererTest, BatchesComeTogetherInOrder) {
  const Intersector scene = MustIntersect(MakeDiffuseBox());
  const auto maps = MustUpload(scene, 20);
  PhotonRenderOptions options{
      .width = 200, .height = 170, .camera = {.samples_per_pixel = 2, .light_strata = 1}};
  options.indirect = {.k = 0, .radius = 10};
  std::uint64_t pixels = 0;
  options.progress = [&](std::uint64_t done) {
    EXPECT_GT(done, pixels);
    pixels = done;
  };
  const auto render = MustRender(scene, maps.refs(), options);
  EXPECT_EQ(pixels, 200u * 170);
  EXPECT_EQ(render.indirect.queries, 2u * 200 * 170);
  const auto direct =
      MustRender(scene, {}, {.width = 200, .height = 170, .camera = options.camera});
  for (std::size_t i = 0; i < direct.image.pixels.size(); ++i) {
    ASSERT_GE(render.image.pixels[i].r, direct.image.pixels[i].r) << i;
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
