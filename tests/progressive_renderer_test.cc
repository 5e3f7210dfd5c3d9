#include "client/render/progressive_renderer.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "client/render/shrinking_radius.h"
#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/photon_renders.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

class ProgressiveRendererTest : public testing::PhotonRenders {
 protected:
  ProgressiveResult MustRenderPasses(const Intersector& scene, const ProgressiveOptions& options) {
    auto rendered = RenderProgressively(scene, *client_, options);
    EXPECT_TRUE(rendered.ok()) << rendered.status();
    EXPECT_TRUE(client_->ListPhotonMaps()->empty());
    return *std::move(rendered);
  }
};

/// A small picture of few photons.
ProgressiveOptions SmallOptions(std::uint64_t passes) {
  ProgressiveOptions options;
  options.pass.width = options.pass.height = 16;
  options.indirect_photons = 1'000;
  options.caustic_photons = 200;
  options.max_passes = passes;
  return options;
}

// In a closed box whose walls emit E and reflect rho the radiance is E / (1 - rho) everywhere. It
// is the same for all radii: what is wrong is noise, and the passes know how much.
TEST_F(ProgressiveRendererTest, FurnaceHasTheAnalyticRadianceAndTheErrorThatIsEstimated) {
  Scene furnace = testing::MakeFurnace(0.5f, 2);
  furnace.camera.vertical_fov_degrees = 25;  // away from edges
  const Intersector scene = testing::MustIntersect(furnace);
  const std::uint32_t fresh = std::random_device{}();
  SCOPED_TRACE(fresh);
  double estimated = 0, measured = 0;
  for (const std::uint64_t seed : {1u, 2u, 3u, fresh}) {
    ProgressiveOptions options = SmallOptions(10);
    options.indirect_photons = 10'000;
    options.pass.indirect.k = 0;
    options.indirect.given = 0.06f;  // pixels share few photons
    options.pass.camera.light_strata = 4;
    options.seed = seed;
    const auto result = MustRenderPasses(scene, options);
    EXPECT_EQ(result.end, ProgressiveEnd::kPasses);
    EXPECT_EQ(result.last.passes, 10u);
    EXPECT_GE(result.last.photons, 100'000u);
    Image truth(16, 16);
    truth.pixels.assign(truth.pixels.size(), Rgb{4, 4, 4});
    const auto error = Compare(result.image, truth);
    ASSERT_TRUE(error.ok());
    EXPECT_NEAR(error->mean_ratio, 1, 0.02);
    ASSERT_TRUE(result.last.error);
    estimated += result.last.error->variance;  // there is no blur
    measured += error->relative_mse;
  }
  // 0.94 to 1.33 for one seed.
  EXPECT_NEAR(estimated / measured, 1, 0.3);
}

// The floor below the image of a lamp in a mirror: E = L A cos cos' / d^2 = 9 L A / d^4.
TEST_F(ProgressiveRendererTest, CausticsHaveTheAnalyticRadiance) {
  constexpr float kLampSide = 0.1f, kRadiance = 50;
  const Intersector scene =
      testing::MustIntersect(testing::MakeLampUnderMirror(kRadiance, kLampSide));
  constexpr int kSide = 6;
  ProgressiveOptions options = SmallOptions(10);
  options.pass.width = options.pass.height = kSide;
  options.indirect_photons = 0;
  options.caustic_photons = 60'000;
  options.pass.caustic.k = 0;
  options.caustic.given = 0.5f;
  const auto result = MustRenderPasses(scene, options);
  EXPECT_EQ(result.last.indirect.radius, 0);
  EXPECT_LT(result.last.caustic.radius, 0.4f);
  const CameraRays camera(scene.scene().camera, kSide, kSide);
  double mean = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const auto hit = scene.Intersect(camera.Through(i % kSide + 0.5f, i / kSide + 0.5f));
    ASSERT_TRUE(hit);
    const Vec3 path = hit->position - Vec3{0, 3, 0};
    const double irradiance = 9 * kRadiance * kLampSide * kLampSide / std::pow(Dot(path, path), 2);
    const double expected = 0.5 / std::numbers::pi * irradiance;
    EXPECT_NEAR(result.image.pixels[i].g, expected, 0.15 * expected) << i;
    mean += result.image.pixels[i].g / expected / (kSide * kSide);
  }
  EXPECT_NEAR(mean, 1, 0.03);
}

TEST_F(ProgressiveRendererTest, GivesTheSamePictureForAnyNumberOfThreads) {
  const Intersector scene = testing::MustIntersect(MakeCornell());
  std::vector<ProgressiveResult> results;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    results.push_back(MustRenderPasses(scene, SmallOptions(4)));
  }
  for (const auto& result : results) {
    EXPECT_EQ(result.image.pixels, results[0].image.pixels);
    EXPECT_EQ(result.last.error->relative_mse(), results[0].last.error->relative_mse());
  }
}

// A pass is a picture of its own: the mean of the pictures that RenderPhotonMaps gives.
TEST_F(ProgressiveRendererTest, IsTheMeanOfItsPasses) {
  const Intersector scene = testing::MustIntersect(MakeCornell());
  std::vector<Image> means;
  ProgressiveOptions options = SmallOptions(3);
  options.pass_done = [&](const PassReport& pass, const PassStatistics& statistics) {
    EXPECT_EQ(pass.passes, statistics.passes());
    EXPECT_EQ(pass.error.has_value(), pass.passes > 1);
    means.push_back(statistics.Mean());
    return absl::OkStatus();
  };
  const auto three = MustRenderPasses(scene, options);
  ASSERT_EQ(means.size(), 3u);
  EXPECT_EQ(means.back().pixels, three.image.pixels);
  options.max_passes = 1;
  EXPECT_EQ(MustRenderPasses(scene, options).image.pixels, means[0].pixels);
  EXPECT_NE(means[1].pixels, means[0].pixels);
}

TEST_F(ProgressiveRendererTest, EndsAtTheTargetError) {
  const Intersector scene = testing::MustIntersect(testing::MakeDiffuseBox());
  ProgressiveOptions options = SmallOptions(1'000);
  options.target_error = 0.05;
  std::vector<double> errors;
  options.pass_done = [&](const PassReport& pass, const PassStatistics&) {
    errors.push_back(pass.error ? pass.error->relative_rms() : 1);
    return absl::OkStatus();
  };
  const auto result = MustRenderPasses(scene, options);
  EXPECT_EQ(result.end, ProgressiveEnd::kTargetError);
  ASSERT_GT(errors.size(), kMinPassesOfTarget);
  EXPECT_LT(errors.size(), 200u);
  EXPECT_LE(errors.back(), 0.05);
  for (std::size_t i = kMinPassesOfTarget; i < errors.size(); ++i) EXPECT_GT(errors[i - 1], 0.05);
}

// What is known beforehand counts as two passes, and goes with the squared radius.
TEST_F(ProgressiveRendererTest, KnowsTheBlurThatItIsTold) {
  const Intersector scene = testing::MustIntersect(MakeCornell());
  ProgressiveOptions options = SmallOptions(6);
  options.known_squared_bias = 1e3;
  options.constant_passes = 4;
  std::vector<double> biases;
  options.pass_done = [&](const PassReport& pass, const PassStatistics&) {
    if (pass.error) biases.push_back(pass.error->squared_bias);
    return absl::OkStatus();
  };
  MustRenderPasses(scene, options);
  ASSERT_EQ(biases.size(), 5u);
  // Beside it what passes find is nothing.
  EXPECT_NEAR(biases[0], 1e3 * 2 / 4, 1);
  EXPECT_NEAR(biases[1], 1e3 * 2 / 5, 1);
  EXPECT_NEAR(biases[2], 1e3 * 2 / 6, 1);
  EXPECT_NEAR(biases[3], 1e3 * (4 + kRadiusAlpha) / 5 * 2 / 7, 1);
  EXPECT_LT(biases[4], biases[3]);
}

// Only passes of the first radius are judged, and those not before two are done.
TEST_F(ProgressiveRendererTest, EndsWhereTheFirstRadiusBlursTooMuch) {
  const Intersector scene = testing::MustIntersect(MakeCornell());
  ProgressiveOptions options = SmallOptions(4);
  options.known_squared_bias = 1e3;
  options.min_passes_of_target = 2;
  options.constant_passes = 2;
  options.max_squared_bias = 400;  // half of what is known, and next to nothing
  const auto blurred = MustRenderPasses(scene, options);
  EXPECT_EQ(blurred.end, ProgressiveEnd::kTooBlurred);
  EXPECT_EQ(blurred.last.passes, 2u);
  options.constant_passes = 1;
  EXPECT_EQ(MustRenderPasses(scene, options).end, ProgressiveEnd::kPasses);
  options.constant_passes = 2;
  options.max_squared_bias = 600;
  EXPECT_EQ(MustRenderPasses(scene, options).end, ProgressiveEnd::kPasses);
}

TEST_F(ProgressiveRendererTest, EndsWhenTheTimeIsUpButNotBeforeTheFirstPass) {
  const Intersector scene = testing::MustIntersect(testing::MakeDiffuseBox());
  ProgressiveOptions options = SmallOptions(1'000'000);
  options.time_limit_s = 0;
  EXPECT_EQ(MustRenderPasses(scene, options).last.passes, 1u);
  options.time_limit_s = 0.5;
  const auto begin = std::chrono::steady_clock::now();
  const auto result = MustRenderPasses(scene, options);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(result.end, ProgressiveEnd::kTimeLimit);
  EXPECT_GT(result.last.passes, 1u);
  EXPECT_LT(result.last.seconds, 0.6);
  EXPECT_LT(seconds.count(), 5);  // a machine may be busy; without the limit it would be hours
}

TEST_F(ProgressiveRendererTest, AnInterruptionLeavesThePassesThatAreDone) {
  const Intersector scene = testing::MustIntersect(MakeCornell());
  std::atomic<bool> interrupted = false;
  ProgressiveOptions options = SmallOptions(1'000'000);
  options.interrupted = [&] { return interrupted.load(); };
  Image mean;
  options.pass_done = [&](const PassReport& pass, const PassStatistics& statistics) {
    mean = statistics.Mean();
    interrupted = pass.passes == 3;
    return absl::OkStatus();
  };
  const auto result = MustRenderPasses(scene, options);
  EXPECT_EQ(result.end, ProgressiveEnd::kInterrupted);
  EXPECT_EQ(result.last.passes, 3u);
  EXPECT_EQ(result.image.pixels, mean.pixels);
  EXPECT_TRUE(result.deleted.ok()) << result.deleted;

  interrupted = true;
  const auto none = RenderProgressively(scene, *client_, options);
  EXPECT_EQ(none.status().code(), absl::StatusCode::kCancelled);
  EXPECT_TRUE(client_->ListPhotonMaps()->empty());
}

// Interrupted while the first pass is rendered, at any of its questions.
TEST_F(ProgressiveRendererTest, AnInterruptionAtAnyTimeRemovesTheMaps) {
  const Intersector scene = testing::MustIntersect(testing::MakeDiffuseBox());
  for (int questions = 0; questions < 12; ++questions) {
    std::atomic<int> asked = 0;
    ProgressiveOptions options = SmallOptions(2);
    options.interrupted = [&] { return asked++ >= questions; };
    const auto result = RenderProgressively(scene, *client_, options);
    if (!result.ok()) {
      EXPECT_EQ(result.status().code(), absl::StatusCode::kCancelled) << questions;
    }
    EXPECT_TRUE(client_->ListPhotonMaps()->empty()) << questions;
  }
}

// The maps of the pass that is rendered and of the next one; they expire.
TEST_F(ProgressiveRendererTest, AtMostTwoPassesHaveMapsAndTheyExpire) {
  const Intersector scene = testing::MustIntersect(MakeCornell());
  ProgressiveOptions options = SmallOptions(6);
  options.map_name = "mine";
  options.pass_done = [&](const PassReport&, const PassStatistics&) {
    const auto maps = client_->ListPhotonMaps();
    EXPECT_LE(maps->size(), 4u);
    for (const auto& map : *maps) {
      EXPECT_TRUE(map.name() == "mine.indirect" || map.name() == "mine.caustic") << map.name();
      EXPECT_GT(map.expires_unix_ms(), map.created_unix_ms());
    }
    return absl::OkStatus();
  };
  MustRenderPasses(scene, options);
}

TEST_F(ProgressiveRendererTest, AnErrorOfTheCallerEndsTheRun) {
  const Intersector scene = testing::MustIntersect(testing::MakeDiffuseBox());
  ProgressiveOptions options = SmallOptions(9);
  options.pass_done = [](const PassReport&, const PassStatistics&) {
    return absl::DataLossError("mine");
  };
  EXPECT_EQ(RenderProgressively(scene, *client_, options).status(), absl::DataLossError("mine"));
  EXPECT_TRUE(client_->ListPhotonMaps()->empty());
}

TEST_F(ProgressiveRendererTest, OptionsOutOfRangeAreRefused) {
  const Intersector scene = testing::MustIntersect(testing::MakeDiffuseBox());
  const auto code = [&](auto change) {
    ProgressiveOptions options = SmallOptions(1);
    change(options);
    return RenderProgressively(scene, *client_, options).status().code();
  };
  constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;
  EXPECT_EQ(code([](auto& o) { o.max_passes = 0; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.constant_passes = 0; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.known_squared_bias = -1; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.max_squared_bias = NAN; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.min_passes_of_target = 1; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.target_error = -1; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.target_error = NAN; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.time_limit_s = NAN; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.pass.indirect.k = kMinProgressiveNeighbors - 1; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.caustic.k = 0; }), kInvalid);
  EXPECT_EQ(code([](auto& o) { o.pass.width = 0; }), kInvalid);
  EXPECT_TRUE(client_->ListPhotonMaps()->empty());
}

}  // namespace
}  // namespace treelight::client
