#include "client/render/pilot.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "client/scenes/cornell.h"
#include "core/builder.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/photon_renders.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using testing::MustIntersect;

class PilotTest : public testing::PhotonRenders {
 protected:
  void SetUp() override {
    Start(MakeCpuBuilder());
    ASSERT_NE(server_, nullptr);
    client_.emplace(server_->InProcessChannel());
  }

  PilotReport MustRunPilot(const Intersector& scene, const ProgressiveOptions& options,
                           const PilotSize& size = {}) {
    const auto report = RunPilot(scene, *client_, options, size);
    EXPECT_TRUE(report.ok()) << report.status();
    EXPECT_TRUE(client_->ListPhotonMaps()->empty());
    return *report;
  }
};

ProgressiveOptions SmallOptions(std::uint64_t seed) {
  ProgressiveOptions options;
  options.pass.width = options.pass.height = 32;
  options.seed = seed;
  return options;
}

// The furnace has neither edges nor lamps that a pixel's rays may miss: few rays tell their noise.
TEST_F(PilotTest, PredictsTheNoiseOfPasses) {
  Scene furnace = testing::MakeFurnace(0.5f, 2);
  furnace.camera.vertical_fov_degrees = 25;  // away from edges
  const Intersector scene = MustIntersect(furnace);
  const std::uint32_t fresh = std::random_device{}();
  SCOPED_TRACE(fresh);
  const PassPlan plan{.photons = 40'000, .k = 64, .samples_per_pixel = 2, .passes = 12};
  double predicted = 0, measured = 0, blur_of_one = 0;
  for (const std::uint64_t seed : {std::uint64_t{1}, std::uint64_t{fresh}}) {
    const PilotFindings found = MustRunPilot(scene, SmallOptions(seed)).findings;
    predicted += PredictVariance(found, plan.photons, plan.k, plan.samples_per_pixel) / 2;
    if (seed == 1) blur_of_one = PredictSquaredBias(found, plan.photons, plan.k);
    ProgressiveOptions options = Planned(SmallOptions(seed), plan);
    options.max_passes = plan.passes;
    const auto result = RenderProgressively(scene, *client_, options);
    ASSERT_TRUE(result.ok()) << result.status();
    measured += 12 * result->last.error->variance / 2;
  }
  EXPECT_NEAR(predicted / measured, 1, 0.3);
  // There is no blur. What noise looks like it scatters widely: of one pilot in eight it is more
  // than the noise itself.
  EXPECT_LT(blur_of_one, 0.5 * measured);
  std::vector<double> blurs;
  for (std::uint64_t i = 0; i < 9; ++i) {
    const PilotFindings found = MustRunPilot(scene, SmallOptions(fresh + i)).findings;
    blurs.push_back(PredictSquaredBias(found, plan.photons, plan.k));
  }
  std::nth_element(blurs.begin(), blurs.begin() + 4, blurs.end());
  EXPECT_LT(blurs[4], 1.5 * measured);
}

TEST_F(PilotTest, FindsTheBlurOfEdges) {
  const Intersector scene = MustIntersect(MakeCornell());
  const PilotFindings found = MustRunPilot(scene, SmallOptions(1)).findings;
  const double few = std::sqrt(PredictSquaredBias(found, 5'000, 64));
  const double many = std::sqrt(PredictSquaredBias(found, 1'000'000, 64));
  EXPECT_GT(few, 0.03);
  EXPECT_LT(few, 0.5);
  EXPECT_LT(many, 0.3 * few);
  EXPECT_GT(found.shared, 0.5);  // discs are larger than pixels
  EXPECT_LE(found.shared, 1);
  EXPECT_GT(found.camera_variance, 0);
  EXPECT_GT(found.gather_s, found.quarter_gather_s);
}

TEST_F(PilotTest, FindsTheSameForAnyNumberOfThreads) {
  const Intersector scene = MustIntersect(MakeCornell());
  std::vector<PilotFindings> findings;
  for (const std::size_t threads : {1, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    findings.push_back(MustRunPilot(scene, SmallOptions(1)).findings);
  }
  EXPECT_EQ(findings[0].photon_variance, findings[1].photon_variance);
  EXPECT_EQ(findings[0].camera_variance, findings[1].camera_variance);
  EXPECT_EQ(findings[0].shared, findings[1].shared);
  EXPECT_EQ(findings[0].within_quarter, findings[1].within_quarter);
  EXPECT_EQ(findings[0].squared_difference, findings[1].squared_difference);
}

TEST_F(PilotTest, LooksAtAFewPixelsOfALargePicture) {
  const Intersector scene = MustIntersect(testing::MakeDiffuseBox());
  ProgressiveOptions options = SmallOptions(1);
  options.pass.width = 150, options.pass.height = 70;  // every fourth: of 152 and 72
  const PilotReport report = MustRunPilot(scene, options);
  EXPECT_GE(report.photons, 40'000u);
  EXPECT_LT(report.photons, 41'000u);  // there are no caustics
  EXPECT_GT(report.findings.photon_variance, 0);
}

TEST_F(PilotTest, ALargerOneIsForPlansThatTakeLong) {
  const Intersector scene = MustIntersect(testing::MakeDiffuseBox());  // without caustics
  const auto plan = [&](double target_error) {
    ProgressiveOptions options = SmallOptions(1);
    options.target_error = target_error;
    return PlanByPilots(scene, *client_, options, {});
  };
  const auto short_plan = plan(1), long_plan = plan(1e-4);
  ASSERT_TRUE(short_plan.ok() && long_plan.ok());
  EXPECT_NEAR(short_plan->pilot.photons, 2 * kSmallPilot.photons, 100);
  EXPECT_EQ(short_plan->pilot.findings.photons, kSmallPilot.photons);
  EXPECT_NEAR(long_plan->pilot.photons, 2 * (kSmallPilot.photons + PilotSize{}.photons), 1000);
  EXPECT_EQ(long_plan->pilot.findings.photons, PilotSize{}.photons);
  EXPECT_GT(long_plan->plan.seconds, short_plan->plan.seconds);
}

TEST_F(PilotTest, PlannedKeepsTheRatioOfBothMaps) {
  ProgressiveOptions options;
  options.indirect_photons = 1'000'000, options.caustic_photons = 200'000;
  const auto planned = Planned(
      options,
      {.photons = 50'000, .k = 200, .samples_per_pixel = 3, .passes = 7, .squared_bias = 0.01});
  EXPECT_EQ(planned.indirect_photons, 50'000u);
  EXPECT_EQ(planned.caustic_photons, 10'000u);
  EXPECT_EQ(planned.pass.indirect.k, 200u);
  EXPECT_EQ(planned.pass.caustic.k, 120u);
  EXPECT_EQ(planned.caustic.k, 120u);
  EXPECT_EQ(planned.pass.camera.samples_per_pixel, 3u);
  EXPECT_EQ(planned.constant_passes, 7u);
  EXPECT_EQ(planned.known_squared_bias, 0.01);
  options.caustic_photons = 0;
  EXPECT_EQ(Planned(options, {.photons = 50'000, .k = 40}).caustic_photons, 0u);
  EXPECT_EQ(Planned(options, {.photons = 50'000, .k = 30}).caustic.k, kMinProgressiveNeighbors);
}

TEST_F(PilotTest, AnInterruptionLeavesNoMaps) {
  const Intersector scene = MustIntersect(testing::MakeDiffuseBox());
  for (const int questions : {0, 1, 3, 5}) {
    int asked = 0;
    ProgressiveOptions options = SmallOptions(1);
    options.interrupted = [&] { return asked++ >= questions; };
    const auto report = RunPilot(scene, *client_, options, {});
    EXPECT_EQ(report.status().code(), absl::StatusCode::kCancelled) << questions;
    EXPECT_TRUE(client_->ListPhotonMaps()->empty());
  }
}

}  // namespace
}  // namespace treelight::client
