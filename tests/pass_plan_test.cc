#include "client/render/pass_plan.h"

#include <cmath>

#include "client/render/pass_statistics.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

/// A scene of 20 000 pilot photons whose parts can be told apart.
PilotFindings SomeFindings() {
  return {.photons = 20'000,
          .k = 100,
          .camera_variance = 0.04,
          .photon_variance = 0.01,
          .shared = 1,
          .squared_difference = 1e-4,
          .photon_s = 1e-6,
          .camera_s = 1e-6,
          .gather_s = 2e-6,
          .quarter_gather_s = 8e-7,
          .pass_s = 0.01};
}

TEST(PassPlan, BiasGoesWithTheArea) {
  const PilotFindings pilot = SomeFindings();
  const double bias = PredictSquaredBias(pilot, 20'000, 100);
  EXPECT_LT(bias, 1e-4 / PassStatistics::kRimShare);
  EXPECT_GT(bias, 1e-4 / PassStatistics::kDifferenceShare);
  const double in_a_quarter = bias / std::sqrt(8.0);
  EXPECT_NEAR(PredictSquaredBias(pilot, 80'000, 100), in_a_quarter, 1e-12);
  EXPECT_NEAR(PredictSquaredBias(pilot, 320'000, 400), in_a_quarter,
              1e-12);  // of four times as many
}

TEST(PassPlan, VarianceOfAPass) {
  PilotFindings pilot = SomeFindings();
  EXPECT_NEAR(PredictVariance(pilot, 20'000, 100, 1), 0.05, 1e-12);
  EXPECT_NEAR(PredictVariance(pilot, 20'000, 100, 4), 0.02, 1e-12);
  EXPECT_NEAR(PredictVariance(pilot, 20'000, 400, 1), 0.0425, 1e-12);
  // Half of the noise is shared: a pixel is as large as a disc, and four times as large as one of
  // a quarter of its area, where a fifth is shared.
  pilot.shared = 0.5;
  EXPECT_NEAR(PredictVariance(pilot, 20'000, 100, 4), 0.005 + 0.045 / 4, 1e-12);
  EXPECT_NEAR(PredictVariance(pilot, 80'000, 100, 4), 0.002 + 0.048 / 4, 1e-12);
}

// Nine cells of a pixel, of which an edge crosses about three.
TEST(PassPlan, StratifiedSamplesHaveLessNoiseOfEdges) {
  PilotFindings pilot = SomeFindings();
  pilot.photon_variance = 0;
  const auto variance = [&pilot](std::uint32_t samples) {
    return PredictVariance(pilot, 20'000, 100, samples);
  };
  pilot.within_quarter = 0.5;  // all of edges
  EXPECT_NEAR(variance(1), 0.04, 1e-12);
  EXPECT_NEAR(variance(4), 0.04 / 8, 1e-12);
  EXPECT_NEAR(variance(9), 0.04 / 27, 1e-12);
  EXPECT_NEAR(variance(5), 0.04 * (2 + 1) / 25, 1e-12);  // four in cells, one anywhere
  pilot.within_quarter = 0.75;                           // half of them
  EXPECT_NEAR(variance(9), 0.02 / 27 + 0.02 / 9, 1e-12);
  pilot.within_quarter = 0.2;  // no less than edges have
  EXPECT_NEAR(variance(9), 0.04 / 27, 1e-12);
}

TEST(PassPlan, ReachesTheTargetAndTakesMoreForLess) {
  double seconds = 0;
  for (const double target : {0.2, 0.1, 0.05, 0.03, 0.02}) {
    const PassPlan plan = PlanPasses(SomeFindings(), target, 16'384, {});
    EXPECT_LE(plan.variance + plan.squared_bias, target * target);
    EXPECT_GE(plan.passes, 2u);
    EXPECT_GE(plan.seconds, seconds);
    seconds = plan.seconds;
    EXPECT_NEAR(plan.variance * static_cast<double>(plan.passes),
                PredictVariance(SomeFindings(), plan.photons, plan.k, plan.samples_per_pixel),
                1e-12);
  }
}

TEST(PassPlan, FollowsWhatIsDear) {
  PilotFindings dear_photons = SomeFindings(), dear_pass = SomeFindings();
  dear_photons.photon_s = 1e-4;
  dear_pass.pass_s = 10;
  const auto plan = [](const PilotFindings& pilot) { return PlanPasses(pilot, 0.03, 16'384, {}); };
  EXPECT_LT(plan(dear_photons).photons * plan(dear_photons).passes,
            plan(SomeFindings()).photons * plan(SomeFindings()).passes);
  EXPECT_LE(plan(dear_pass).passes, 4u);
  EXPECT_LT(plan(dear_pass).passes, plan(SomeFindings()).passes);
  // Noise of the camera alone: samples, not photons.
  PilotFindings camera = SomeFindings();
  camera.photon_variance = camera.squared_difference = 0;
  EXPECT_EQ(plan(camera).photons, 5'000u);
}

TEST(PassPlan, KeepsWhatIsGiven) {
  const PassPlan plan =
      PlanPasses(SomeFindings(), 0.05, 16'384, {.k = 77, .samples_per_pixel = 3, .min_passes = 9});
  EXPECT_EQ(plan.k, 77u);
  EXPECT_EQ(plan.samples_per_pixel, 3u);
  EXPECT_GE(plan.passes, 9u);
}

TEST(PassPlan, EveryPixelGetsEnoughSamplesToTellItsNoise) {
  const PlanLimits limits{.min_passes = 2, .min_samples = 8};
  EXPECT_EQ(limits.MinPasses(1), 8u);
  EXPECT_EQ(limits.MinPasses(3), 3u);
  EXPECT_EQ(limits.MinPasses(4), 2u);
  EXPECT_EQ(limits.MinPasses(64), 2u);
  const PassPlan plan = PlanPasses(SomeFindings(), 0.9, 16'384, limits);
  EXPECT_GE(plan.passes * plan.samples_per_pixel, 8u);
}

TEST(PassPlan, WhereNoneReachesTheTargetTheLeastBlurIsTaken) {
  const PassPlan plan = PlanPasses(SomeFindings(), 1e-3, 16'384, {});
  EXPECT_GT(plan.squared_bias, 1e-6);
  EXPECT_EQ(plan.k, 40u);
  EXPECT_GT(plan.photons, 7'000'000u);
}

}  // namespace
}  // namespace treelight::client
