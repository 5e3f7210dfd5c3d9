#include "client/render/image_photons.h"

#include <array>
#include <cmath>
#include <string>

#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeClosedBox;
using ::treelight::testing::MustIntersect;

Scene MakeGreyBox(float albedo) {
  return MakeClosedBox({.name = "grey", .reflectance = {albedo, albedo, albedo}});
}

ImagePhotons MustTrace(const Scene& scene, const ImagePhotonOptions& options) {
  auto photons = TraceImagePhotons(MustIntersect(scene), options);
  EXPECT_TRUE(photons.ok()) << photons.status();
  return *std::move(photons);
}

/// How many of the photons are on each wall of the unit box: at 0 and 1 of x, y and z.
std::array<double, 6> WallCounts(const ImagePhotons& photons) {
  std::array<double, 6> counts{};
  for (std::size_t i = 0; i < photons.positions.size(); i += 3) {
    for (int axis = 0; axis < 3; ++axis) {
      if (photons.positions[i + axis] < 1e-5f) ++counts[2 * axis];
      if (photons.positions[i + axis] > 1 - 1e-5f) ++counts[2 * axis + 1];
    }
  }
  return counts;
}

// In a closed box a path of albedo rho meets 1 / (1 - rho) walls, cut to n + 1 by n bounces.
TEST(ImagePhotons, AreAllDiffuseHits) {
  const float albedo = 0.65f;
  const ImagePhotons photons =
      MustTrace(MakeGreyBox(albedo), {.count = 100'000, .width = 301, .height = 203, .seed = 1});
  EXPECT_EQ(photons.positions.size(), 300'000u);
  EXPECT_EQ(photons.paths, 301u * 203);
  const double per_path = static_cast<double>(photons.generated) / (301.0 * 203);
  EXPECT_NEAR(per_path, 1 / (1 - 0.65), 0.03);
  EXPECT_GE(photons.rays, photons.generated);
  const ImagePhotons seen = MustTrace(
      MakeGreyBox(albedo), {.count = 1, .width = 64, .height = 64, .max_bounces = 1, .seed = 2});
  EXPECT_NEAR(static_cast<double>(seen.generated) / 4096, 1.65, 0.03);
}

// Black walls: what the camera sees, in proportion to the pixels. It stands at z = 0.95 and looks
// at the wall z = 0 with 60 degrees: up to 0.95 tan 30 = 0.548 from the middle.
TEST(ImagePhotons, BeginWhereTheCameraSees) {
  const ImagePhotons photons = MustTrace(
      MakeGreyBox(0), {.count = 10'000, .width = 200, .height = 200, .samples_per_pixel = 2});
  EXPECT_EQ(photons.generated, 80'000u);
  const double share = WallCounts(photons)[4] / 10'000;
  const double half = 0.95 * std::tan(30 * M_PI / 180);
  EXPECT_NEAR(share, 1 / (4 * half * half), 0.02);
}

// Those that are chosen are like all of them, early and late paths alike.
TEST(ImagePhotons, AreAFairChoice) {
  const Scene scene = MakeGreyBox(0.5f);
  ImagePhotonOptions options{.count = 1, .width = 256, .height = 256, .seed = 3};
  const ImagePhotons one = MustTrace(scene, options);
  options.count = one.generated;
  const ImagePhotons all = MustTrace(scene, options);
  options.count = one.generated / 8;
  const ImagePhotons chosen = MustTrace(scene, options);
  const auto all_counts = WallCounts(all), counts = WallCounts(chosen);
  for (int wall = 0; wall < 6; ++wall) {
    const double expected = all_counts[wall] / 8;
    EXPECT_NEAR(counts[wall], expected, 4 * std::sqrt(expected)) << wall;
  }
  // Paths run from the top of the picture to its bottom, and first hits with them.
  const auto upper = [](const ImagePhotons& photons) {
    double count = 0;
    for (std::size_t i = 0; i < photons.positions.size(); i += 3)
      count += photons.positions[i + 2] < 1e-5f && photons.positions[i + 1] > 0.8f;
    return count;
  };
  EXPECT_NEAR(upper(chosen), upper(all) / 8, 4 * std::sqrt(upper(all) / 8));
}

TEST(ImagePhotons, AreNotOnMirrorsOrGlass) {
  const Scene scene = MakeCornell();
  const ImagePhotons photons = MustTrace(scene, {.count = 50'000, .seed = 4});
  for (std::size_t i = 0; i < photons.positions.size(); i += 3) {
    const Vec3 p{photons.positions[i], photons.positions[i + 1], photons.positions[i + 2]};
    for (const Sphere& sphere : scene.spheres)
      ASSERT_GT(Length(p - sphere.center), sphere.radius + 1e-6f);
  }
}

TEST(ImagePhotons, AreTheSameForAnyNumberOfThreads) {
  std::vector<ImagePhotons> runs;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    runs.push_back(MustTrace(MakeCornell(), {.count = 15'000, .width = 150, .height = 99}));
  }
  for (const ImagePhotons& run : runs) {
    EXPECT_EQ(run.positions, runs[0].positions);
    EXPECT_EQ(run.generated, runs[0].generated);
  }
  EXPECT_NE(
      MustTrace(MakeCornell(), {.count = 15'000, .width = 150, .height = 99, .seed = 2}).positions,
      runs[0].positions);
}

TEST(ImagePhotons, RefusesWhatCannotBeChosen) {
  const Intersector scene = MustIntersect(MakeGreyBox(0));
  const auto few = TraceImagePhotons(scene, {.count = 5, .width = 2, .height = 2}).status();
  EXPECT_EQ(few.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(std::string(few.message()).substr(0, 59),
            "4 paths generated 4 image photons, 5 are to be chosen: take");
  for (const ImagePhotonOptions& options :
       {ImagePhotonOptions{.count = 0}, ImagePhotonOptions{.width = 0},
        ImagePhotonOptions{.samples_per_pixel = 0}, ImagePhotonOptions{.max_bounces = 0}}) {
    EXPECT_EQ(TraceImagePhotons(scene, options).status().code(),
              absl::StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace treelight::client
