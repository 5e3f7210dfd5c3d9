#include "client/trace/photon_tracer.h"

#include <cmath>
#include <numbers>
#include <random>

#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "core/model/octahedral.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeFurnace;
using ::treelight::testing::MakeLampUnderMirror;
using ::treelight::testing::MustIntersect;

TracedPhotons MustTrace(const Scene& scene, const PhotonTraceOptions& options) {
  auto photons = TracePhotons(MustIntersect(scene), options);
  EXPECT_TRUE(photons.ok()) << photons.status();
  return *std::move(photons);
}

double PowerOf(const Photons& photons) {  // red
  double power = 0;
  for (std::size_t i = 0; i < photons.size(); ++i) power += photons.powers[3 * i];
  return power;
}

/// Red power of the photons within `radius` of `center`, per area of the disc.
double Irradiance(const Photons& photons, const Vec3& center, float radius) {
  double power = 0;
  for (std::size_t i = 0; i < photons.size(); ++i) {
    if (SquaredDistance(photons.position(i), center) <= radius * radius)
      power += photons.powers[3 * i];
  }
  return power / (std::numbers::pi * radius * radius);
}

TEST(PhotonTracer, EnergyIsConserved) {
  const auto seed = std::random_device{}();
  const TracedPhotons photons = MustTrace(MakeCornell(), {.photon_count = 50'000, .seed = seed});
  const EnergyBalance& energy = photons.energy;
  const double light[3] = {18, 15, 11};
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(energy.emitted[c], std::numbers::pi * 0.25 * light[c], 1e-5 * energy.emitted[c])
        << "seed " << seed;
    const double sum = energy.absorbed[c] + energy.escaped[c] + energy.roulette[c] + energy.cut[c];
    EXPECT_NEAR(sum, energy.emitted[c], 1e-6 * energy.emitted[c]) << "seed " << seed;
    EXPECT_LT(std::abs(energy.roulette[c]), 0.03 * energy.emitted[c]) << "seed " << seed;
    EXPECT_GT(energy.absorbed[c], 0.3 * energy.emitted[c]);
    EXPECT_GT(energy.escaped[c], 0.1 * energy.emitted[c]);
    EXPECT_EQ(energy.cut[c], 0);
  }
}

TEST(PhotonTracer, CutPathsAreAccounted) {
  const TracedPhotons photons =
      MustTrace(MakeFurnace(0.9f, 1), {.photon_count = 10'000, .seed = 3, .max_bounces = 3});
  const EnergyBalance& energy = photons.energy;
  EXPECT_NEAR(energy.cut[0], std::pow(0.9, 3) * energy.emitted[0], 0.02 * energy.emitted[0]);
  EXPECT_NEAR(energy.absorbed[0] + energy.escaped[0] + energy.roulette[0] + energy.cut[0],
              energy.emitted[0], 1e-6 * energy.emitted[0]);
}

// Every wall emits E and reflects rho: the light that was reflected before brings pi E rho / (1 -
// rho).
TEST(PhotonTracer, FurnaceHasTheAnalyticIrradiance) {
  for (const float rho : {0.3f, 0.8f}) {
    Scene furnace = MakeFurnace(rho, 2);
    const TracedPhotons photons = MustTrace(furnace, {.photon_count = 200'000, .seed = 4});
    const double expected = std::numbers::pi * 2 * rho / (1 - rho);
    EXPECT_NEAR(photons.energy.emitted[0], std::numbers::pi * 2 * 6, 1e-3);
    EXPECT_NEAR(PowerOf(photons.indirect) / 6, expected, 0.01 * expected) << rho;
    EXPECT_EQ(photons.energy.escaped[0], 0);
    EXPECT_EQ(photons.caustic.size(), 0u);
    for (const Vec3& center :
         {Vec3{0.5f, 0, 0.5f}, Vec3{0.5f, 1, 0.4f}, Vec3{0, 0.4f, 0.5f}, Vec3{0.6f, 0.5f, 1}}) {
      EXPECT_NEAR(Irradiance(photons.indirect, center, 0.35f), expected, 0.04 * expected) << rho;
    }
  }
}

// Glass and a perfect mirror take nothing away, and in a furnace bring as much light as they hide.
TEST(PhotonTracer, LosslessSpheresLeaveTheFurnaceAsItIs) {
  Scene furnace = MakeFurnace(0.5f, 1);
  furnace.materials.push_back(
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f});
  furnace.materials.push_back(
      {.name = "mirror", .surface = Surface::kMirror, .reflectance = {1, 1, 1}});
  furnace.spheres = {{.center = {0.3f, 0.3f, 0.3f}, .radius = 0.2f, .material = 1},
                     {.center = {0.7f, 0.7f, 0.6f}, .radius = 0.2f, .material = 2}};
  const TracedPhotons photons = MustTrace(furnace, {.photon_count = 200'000, .seed = 5});
  const double expected = std::numbers::pi;  // pi E rho / (1 - rho)
  EXPECT_GT(photons.caustic.size(), 0u);
  EXPECT_NEAR(PowerOf(photons.indirect) / 6, expected, 0.01 * expected);
  for (const Vec3& center : {Vec3{0.4f, 0, 0.4f}, Vec3{0.6f, 1, 0.6f}}) {
    EXPECT_NEAR(Irradiance(photons.indirect, center, 0.3f), expected, 0.05 * expected);
  }
}

// The floor is lit from the image of the lamp at y = 3: L A cos^2 / d^2.
TEST(PhotonTracer, CausticOfASmallLampHasTheAnalyticIrradiance) {
  constexpr float kSide = 0.1f, kRadiance = 50;
  const Scene scene = MakeLampUnderMirror(kRadiance, kSide);
  const TracedPhotons photons = MustTrace(scene, {.photon_count = 1'000'000, .seed = 6});
  const float x = 1.5f, radius = 0.4f;
  const double squared_distance = 9 + x * x, squared_cosine = 9 / squared_distance;
  const double expected = kRadiance * kSide * kSide * squared_cosine / squared_distance;
  EXPECT_NEAR(Irradiance(photons.caustic, {x, 0, 0}, radius), expected, 0.02 * expected);
  for (std::size_t i = 0; i < 100; ++i) {  // directions point away from the image of the lamp
    const Vec3 p = photons.caustic.position(i);
    const Vec3 d = Normalize(
        DecodeOctahedral(photons.caustic.directions[2 * i], photons.caustic.directions[2 * i + 1]));
    EXPECT_GT(Dot(d, Normalize(p - Vec3{0, 3, 0})), 0.999f);
  }
}

TEST(PhotonTracer, GivesTheSamePhotonsForAnyNumberOfThreads) {
  const PhotonTraceOptions options{.photon_count = 60'000, .seed = 7};
  std::vector<TracedPhotons> runs;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    runs.push_back(MustTrace(MakeCornell(), options));
  }
  for (const TracedPhotons& run : runs) {
    EXPECT_EQ(run.emitted_paths, runs[0].emitted_paths);
    EXPECT_EQ(run.indirect.positions, runs[0].indirect.positions);
    EXPECT_EQ(run.indirect.powers, runs[0].indirect.powers);
    EXPECT_EQ(run.indirect.directions, runs[0].indirect.directions);
    EXPECT_EQ(run.caustic.positions, runs[0].caustic.positions);
    EXPECT_EQ(run.caustic.powers, runs[0].caustic.powers);
    EXPECT_EQ(run.energy.absorbed, runs[0].energy.absorbed);
  }
  EXPECT_NE(MustTrace(MakeCornell(), {.photon_count = 60'000, .seed = 8}).indirect.positions,
            runs[0].indirect.positions);
}

// The batches are cut where the count is reached: asking for more photons must only add to the end.
TEST(PhotonTracer, MorePhotonsBeginWithTheFewer) {
  const TracedPhotons few = MustTrace(MakeCornell(), {.photon_count = 3'000, .seed = 9});
  const TracedPhotons many = MustTrace(MakeCornell(), {.photon_count = 90'000, .seed = 9});
  const std::size_t stored = few.indirect.size() + few.caustic.size();
  EXPECT_GE(stored, 3'000u);
  EXPECT_LT(stored, 3'050u);  // the last path is kept whole
  ASSERT_GT(many.indirect.size(), few.indirect.size());
  EXPECT_TRUE(std::equal(few.indirect.positions.begin(), few.indirect.positions.end(),
                         many.indirect.positions.begin()));
  EXPECT_TRUE(std::equal(few.caustic.positions.begin(), few.caustic.positions.end(),
                         many.caustic.positions.begin()));
}

TEST(PhotonTracer, RefusesWhatStoresNothing) {
  const auto code = [](const Scene& scene, const PhotonTraceOptions& options) {
    return TracePhotons(MustIntersect(scene), options).status().code();
  };
  EXPECT_EQ(code(MakeCornell(), {.photon_count = 0}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(MakeCornell(), {.photon_count = 1, .max_bounces = 0}),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(MakeFurnace(0.5f, 0), {.photon_count = 1}), absl::StatusCode::kFailedPrecondition);
  // One bounce off black walls: all light is direct.
  EXPECT_EQ(code(MakeFurnace(0, 1), {.photon_count = 1}), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace treelight::client
