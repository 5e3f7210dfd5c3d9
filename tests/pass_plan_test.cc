#include "client/render/pass_plan.h"

#include <cmath>
#include <utility>

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
          .curve_difference = 0,
          .rim_difference = 1e-4,
          .photon_s = 1e-6,
          .camera_s = 1e-6,
          .gather_s = 2e-6,
          .quarter_gather_s = 8e-7,
          .pass_s = 0.01};
}

TEST(PassPlan, DifferencesAreSplitByHowTheyGoWithTheArea) {
  for (const double curve : {0.0, 0.3, 2.0}) {
    for (const double rim : {0.0, 0.5}) {
      const auto parts = SplitDifference(curve + rim, curve / 16 + rim / 2);
      EXPECT_NEAR(parts.curve, curve, 1e-12);
      EXPECT_NEAR(parts.rim, rim, 1e-12);
    }
  }
  // More at the smaller area than rims would have is noise: the larger of both guesses.
  EXPECT_EQ(SplitDifference(0.1, 0.2).curve, 0);
  EXPECT_DOUBLE_EQ(SplitDifference(0.1, 0.2).rim, 0.4);
}

TEST(PassPlan, BiasGoesWithTheArea) {
  PilotFindings pilot = SomeFindings();
  const double rim = 1e-4 / PassStatistics::kRimShare;
  EXPECT_NEAR(PredictSquaredBias(pilot, 20'000, 100), rim, 1e-12);
  EXPECT_NEAR(PredictSquaredBias(pilot, 80'000, 100), rim / 2, 1e-12);   // a quarter of the area
  EXPECT_NEAR(PredictSquaredBias(pilot, 320'000, 400), rim / 2, 1e-12);  // of four times as many
  pilot.curve_difference = std::exchange(pilot.rim_difference, 0);
  EXPECT_NEAR(PredictSquaredBias(pilot, 80'000, 100), rim / 16, 1e-12);
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

TEST(PassPlan, ReachesTheTargetAndTakesMoreForLess) {
  double seconds = 0;
  for (const double target : {0.2, 0.1, 0.05, 0.03, 0.02}) {
    const PassPlan plan = PlanPasses(SomeFindings(), target, 16'384, {});
    EXPECT_LE(plan.variance + plan.squared_bias, target * target);
    EXPECT_GE(plan.passes, 4u);
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
  EXPECT_EQ(plan(dear_pass).passes, 4u);
  // Noise of the camera alone: samples, not photons.
  PilotFindings camera = SomeFindings();
  camera.photon_variance = camera.rim_difference = 0;
  EXPECT_EQ(plan(camera).photons, 5'000u);
}

TEST(PassPlan, KeepsWhatIsGiven) {
  const PassPlan plan =
      PlanPasses(SomeFindings(), 0.05, 16'384, {.k = 77, .samples_per_pixel = 3, .min_passes = 9});
  EXPECT_EQ(plan.k, 77u);
  EXPECT_EQ(plan.samples_per_pixel, 3u);
  EXPECT_GE(plan.passes, 9u);
}

TEST(PassPlan, WhereNoneReachesTheTargetTheLeastBlurIsTaken) {
  const PassPlan plan = PlanPasses(SomeFindings(), 1e-3, 16'384, {});
  EXPECT_GT(plan.squared_bias, 1e-6);
  EXPECT_EQ(plan.k, 40u);
  EXPECT_GT(plan.photons, 7'000'000u);
}

}  // namespace
}  // namespace treelight::client
