#include "client/render/planned_renderer.h"

#include <vector>

#include "client/scenes/load_scene.h"
#include "gtest/gtest.h"
#include "tests/photon_renders.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using testing::MustIntersect;

class PlannedRendererTest : public testing::PhotonRenders {
 protected:
  void SetUp() override {
    Start(MakeCpuBuilder());
    ASSERT_NE(server_, nullptr);
    client_.emplace(server_->InProcessChannel());
  }

  ProgressiveResult MustRender(const Intersector& scene, const ProgressiveOptions& options) {
    plans_.clear();
    auto result =
        RenderPlanned(scene, *client_, options, {.samples_per_pixel = 16}, [&](const auto& found) {
          plans_.push_back(found.plan);
          return absl::OkStatus();
        });
    EXPECT_TRUE(result.ok()) << result.status();
    EXPECT_TRUE(client_->ListPhotonMaps()->empty());
    return *std::move(result);
  }

  std::vector<PassPlan> plans_;
};

ProgressiveOptions SmallOptions(double target_error) {
  ProgressiveOptions options;
  options.pass.width = options.pass.height = 24;
  options.target_error = target_error;
  return options;
}

TEST_F(PlannedRendererTest, EvenLightTakesOnePlan) {
  Scene furnace = testing::MakeFurnace(0.5f, 2);
  furnace.camera.vertical_fov_degrees = 25;  // away from edges
  const auto result = MustRender(MustIntersect(furnace), SmallOptions(0.1));
  EXPECT_EQ(result.end, ProgressiveEnd::kTargetError);
  EXPECT_EQ(plans_.size(), 1u);
}

// Most of the hall is dark, and what its windows light is small beside the discs of a pilot: on
// most machines the first plan is dropped. Which plan is made depends on times, so that it is not
// asked.
TEST_F(PlannedRendererTest, EachPlanBlursLessThanTheOneBefore) {
  auto loaded = LoadScene("hall");
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const auto result = MustRender(MustIntersect(loaded->scene), SmallOptions(0.1));
  EXPECT_EQ(result.end, ProgressiveEnd::kTargetError);
  EXPECT_LE(result.last.error->relative_rms(), 0.1);
  const auto area = [](const PassPlan& plan) {
    return static_cast<double>(plan.k) / static_cast<double>(plan.photons);
  };
  for (std::size_t i = 1; i < plans_.size(); ++i) EXPECT_LT(area(plans_[i]), area(plans_[i - 1]));
}

TEST_F(PlannedRendererTest, AnErrorOfWhoeverIsToldOfThePlanEndsTheRun) {
  const Intersector scene = MustIntersect(testing::MakeDiffuseBox());
  const auto result = RenderPlanned(scene, *client_, SmallOptions(0.1), {}, [](const PilotPlan&) {
    return absl::DataLossError("the curve cannot be written");
  });
  EXPECT_EQ(result.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_TRUE(client_->ListPhotonMaps()->empty());
}

}  // namespace
}  // namespace treelight::client
