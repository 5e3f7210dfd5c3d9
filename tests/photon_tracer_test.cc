#include "client/trace/photon_tracer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "client/render/path_tracer.h"
#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "client/trace/dielectric.h"
#include "client/trace/lights.h"
#include "client/trace/random.h"
#include "client/trace/sampling.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/test_scenes.h"
#include "tests/traced_photons.h"

namespace treelight::client {
namespace {

using ::treelight::testing::DirectionOf;
using ::treelight::testing::Imbalance;
using ::treelight::testing::MakeFurnace;
using ::treelight::testing::MakeLampOverFloor;
using ::treelight::testing::MakeLampUnderMirror;
using ::treelight::testing::MustIntersect;
using ::treelight::testing::MustTrace;

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

/// The Cornell box with every kind of surface and of light.
Scene MakeMotley() {
  Scene scene = MakeCornell();
  scene.materials[0] = {.name = "satin",
                        .surface = Surface::kGlossy,
                        .reflectance = {0.5f, 0.4f, 0.3f},
                        .specular = {0.3f, 0.4f, 0.5f},
                        .exponent = 8};
  scene.materials[5].transmittance = {0.9f, 0.95f, 0.8f};
  scene.materials.push_back({.name = "sheet",
                             .surface = Surface::kPane,
                             .reflectance = {},
                             .ior = 1.5f,
                             .transmittance = {0.9f, 0.8f, 0.7f}});
  AddQuad({-1, 1.2f, 1}, {1, 1.2f, 1}, {1, 1.2f, -1}, {-1, 1.2f, -1}, 6, scene.mesh);
  scene.point_lights = {{.position = {-0.5f, 1.7f, 0}, .intensity = {0.3f, 0.4f, 0.5f}},
                        {.position = {0.5f, 1, 0.9f},
                         .intensity = {2, 2, 2},
                         .direction = Normalize({0, -1, -1}),
                         .cone_degrees = 30,
                         .falloff_begin_degrees = 10}};
  return scene;
}

TEST(PhotonTracer, EnergyIsConserved) {
  const auto seed = std::random_device{}();
  for (const Scene& scene : {MakeCornell(), MakeMotley()}) {
    const TracedPhotons photons =
        MustTrace(scene, {.indirect_photons = 50'000, .caustic_photons = 1'000, .seed = seed});
    const EnergyBalance& energy = photons.report.energy;
    const Rgb power = Lights(scene).power();
    const double expected[3] = {power.r, power.g, power.b};
    const Power imbalance = Imbalance(energy);
    for (int c = 0; c < 3; ++c) {
      // Lights are drawn by the sum of their channels.
      EXPECT_NEAR(energy.emitted[c], expected[c], 0.02 * expected[c]) << "seed " << seed;
      EXPECT_NEAR(imbalance[c], 0, 1e-6 * energy.emitted[c]) << "seed " << seed;
      EXPECT_LT(std::abs(energy.roulette[c]), 0.03 * energy.emitted[c]) << "seed " << seed;
      EXPECT_GT(energy.absorbed_diffuse[c], 0.3 * energy.emitted[c]);
      EXPECT_GT(energy.absorbed_elsewhere[c], 0.001 * energy.emitted[c]);
      EXPECT_GT(energy.escaped[c], 0.03 * energy.emitted[c]);
      EXPECT_EQ(energy.cut[c], 0);
      EXPECT_EQ(energy.shading[c], 0);
    }
  }
}

// Each set in the table is the sum of its photons, and two ways lead to the caustic one.
TEST(PhotonTracer, StoredPowerIsThatOfThePhotons) {
  const TracedPhotons photons =
      MustTrace(MakeMotley(), {.indirect_photons = 100'000, .caustic_photons = 50'000, .seed = 2});
  const TraceReport& report = photons.report;
  EXPECT_EQ(report.indirect.photons, photons.indirect.size());
  EXPECT_EQ(report.caustic.photons, photons.caustic.size());
  EXPECT_NEAR(report.indirect.stored[0], PowerOf(photons.indirect),
              1e-4 * report.indirect.stored[0]);
  EXPECT_NEAR(report.caustic.stored[0], PowerOf(photons.caustic), 1e-4 * report.caustic.stored[0]);
  EXPECT_NEAR(report.indirect.stored[0], report.energy.indirect[0],
              1e-9 * report.energy.indirect[0]);
  EXPECT_NEAR(report.caustic.stored[0], report.energy.caustic[0], 0.03 * report.energy.caustic[0]);
  EXPECT_EQ(report.indirect.max_power, *std::ranges::max_element(photons.indirect.powers));
}

TEST(PhotonTracer, CutPathsAreAccounted) {
  const TracedPhotons photons =
      MustTrace(MakeFurnace(0.9f, 1), {.indirect_photons = 10'000, .seed = 3, .max_bounces = 3});
  const EnergyBalance& energy = photons.report.energy;
  EXPECT_NEAR(energy.cut[0], std::pow(0.9, 3) * energy.emitted[0], 0.02 * energy.emitted[0]);
  EXPECT_NEAR(Imbalance(energy)[0], 0, 1e-6 * energy.emitted[0]);
}

// Every wall emits E and reflects rho: the light that was reflected before brings pi E rho / (1 -
// rho).
TEST(PhotonTracer, FurnaceHasTheAnalyticIrradiance) {
  for (const float rho : {0.3f, 0.8f}) {
    Scene furnace = MakeFurnace(rho, 2);
    const TracedPhotons photons = MustTrace(furnace, {.indirect_photons = 200'000, .seed = 4});
    const double expected = std::numbers::pi * 2 * rho / (1 - rho);
    EXPECT_NEAR(photons.report.energy.emitted[0], std::numbers::pi * 2 * 6, 1e-3);
    EXPECT_NEAR(PowerOf(photons.indirect) / 6, expected, 0.01 * expected) << rho;
    EXPECT_EQ(photons.report.energy.escaped[0], 0);
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
  const TracedPhotons photons = MustTrace(furnace, {.indirect_photons = 200'000, .seed = 5});
  const double expected = std::numbers::pi;  // pi E rho / (1 - rho)
  EXPECT_GT(photons.caustic.size(), 0u);
  EXPECT_NEAR(PowerOf(photons.indirect) / 6, expected, 0.01 * expected);
  for (const Vec3& center : {Vec3{0.4f, 0, 0.4f}, Vec3{0.6f, 1, 0.6f}}) {
    EXPECT_NEAR(Irradiance(photons.indirect, center, 0.3f), expected, 0.05 * expected);
  }
}

// A clear pane takes nothing away: on the walls, direct and stored light make the irradiance of the
// furnace, pi E / (1 - rho). The path tracer sees the radiance E / (1 - rho) through it.
TEST(PhotonTracer, AClearPaneLeavesTheFurnaceAsItIs) {
  Scene furnace = MakeFurnace(0.5f, 1);
  furnace.materials.push_back(
      {.name = "sheet", .surface = Surface::kPane, .reflectance = {}, .ior = 1.5f});
  AddQuad({0, 0.2f, 0.7f}, {1, 0.2f, 0.7f}, {1, 0.6f, 0.4f}, {0, 0.6f, 0.4f}, 1, furnace.mesh);
  const TracedPhotons photons = MustTrace(furnace, {.indirect_photons = 200'000, .seed = 17});
  const EnergyBalance& energy = photons.report.energy;
  const double expected = std::numbers::pi / 0.5;
  EXPECT_NEAR((energy.direct[0] + energy.indirect[0]) / 6, expected, 0.01 * expected);
  const Intersector intersector = MustIntersect(furnace);
  const Lights lights(intersector.scene());
  RandomStream random(17, RandomPurpose::kReferencePath, 0);
  double radiance = 0;
  constexpr int kPaths = 50'000;
  for (int i = 0; i < kPaths; ++i) {
    const float u = random.Uniform(), v = random.Uniform();
    const Ray ray{{0.5f, 0.8f, 0.8f}, CosineDirection({0, -1, 0}, u, v)};
    radiance += TracePath(intersector, lights, ray, random).radiance.r / kPaths;
  }
  EXPECT_NEAR(radiance, 2, 0.02);
}

// The floor is lit from the image of the lamp at y = 3: L A cos^2 / d^2.
TEST(PhotonTracer, CausticOfASmallLampHasTheAnalyticIrradiance) {
  constexpr float kSide = 0.1f, kRadiance = 50;
  const Scene scene = MakeLampUnderMirror(kRadiance, kSide);
  const TracedPhotons photons =
      MustTrace(scene, {.indirect_photons = 0, .caustic_photons = 1'500'000, .seed = 6});
  const float x = 1.5f, radius = 0.4f;
  const double squared_distance = 9 + x * x, squared_cosine = 9 / squared_distance;
  const double expected = kRadiance * kSide * kSide * squared_cosine / squared_distance;
  EXPECT_NEAR(Irradiance(photons.caustic, {x, 0, 0}, radius), expected, 0.02 * expected);
  for (std::size_t i = 0; i < 100; ++i) {  // directions point away from the image of the lamp
    const Vec3 p = photons.caustic.position(i);
    EXPECT_GT(Dot(DirectionOf(photons.caustic, i), Normalize(p - Vec3{0, 3, 0})), 0.999f);
  }
}

TEST(PhotonTracer, GivesTheSamePhotonsForAnyNumberOfThreads) {
  const PhotonTraceOptions options{
      .indirect_photons = 60'000, .caustic_photons = 20'000, .seed = 7};
  std::vector<TracedPhotons> runs;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    runs.push_back(MustTrace(MakeCornell(), options));
  }
  for (const TracedPhotons& run : runs) {
    EXPECT_EQ(run.report.indirect.paths, runs[0].report.indirect.paths);
    EXPECT_EQ(run.indirect.positions, runs[0].indirect.positions);
    EXPECT_EQ(run.indirect.powers, runs[0].indirect.powers);
    EXPECT_EQ(run.indirect.directions, runs[0].indirect.directions);
    EXPECT_EQ(run.caustic.positions, runs[0].caustic.positions);
    EXPECT_EQ(run.caustic.powers, runs[0].caustic.powers);
    EXPECT_EQ(run.caustic.directions, runs[0].caustic.directions);
    EXPECT_EQ(run.report.energy.absorbed_diffuse, runs[0].report.energy.absorbed_diffuse);
  }
  EXPECT_NE(MustTrace(MakeCornell(), {.indirect_photons = 60'000, .seed = 8}).indirect.positions,
            runs[0].indirect.positions);
}

TEST(PhotonTracer, GivesTheSamePhotonsFromEmittersThatWereFoundBefore) {
  const PhotonEmitters emitters(MakeCornell());
  PhotonTraceOptions options{.indirect_photons = 3'000, .caustic_photons = 2'000, .seed = 7};
  const TracedPhotons anew = MustTrace(MakeCornell(), options);
  options.emitters = &emitters;
  for (int set = 0; set < 2; ++set) {
    const TracedPhotons found = MustTrace(MakeCornell(), options);
    EXPECT_EQ(found.indirect.positions, anew.indirect.positions);
    EXPECT_EQ(found.caustic.positions, anew.caustic.positions);
    EXPECT_EQ(found.caustic.powers, anew.caustic.powers);
  }
}

// The batches are cut where the count is reached: asking for more photons must only add to the end.
TEST(PhotonTracer, MorePhotonsBeginWithTheFewer) {
  const TracedPhotons few =
      MustTrace(MakeCornell(), {.indirect_photons = 3'000, .caustic_photons = 2'000, .seed = 9});
  const TracedPhotons many =
      MustTrace(MakeCornell(), {.indirect_photons = 90'000, .caustic_photons = 40'000, .seed = 9});
  EXPECT_GE(few.indirect.size(), 3'000u);
  EXPECT_LT(few.indirect.size(), 3'050u);  // the last path is kept whole
  EXPECT_EQ(few.caustic.size(), 2'000u);
  ASSERT_GT(many.indirect.size(), few.indirect.size());
  ASSERT_GT(many.caustic.size(), few.caustic.size());
  EXPECT_TRUE(std::equal(few.indirect.positions.begin(), few.indirect.positions.end(),
                         many.indirect.positions.begin()));
  EXPECT_TRUE(std::equal(few.caustic.positions.begin(), few.caustic.positions.end(),
                         many.caustic.positions.begin()));
}

TEST(PhotonTracer, BlocksAreThePhotonsBeforeDivision) {
  const PhotonTraceOptions options{
      .indirect_photons = 30'000, .caustic_photons = 5'000, .seed = 10};
  const Intersector scene = MustIntersect(MakeCornell());
  Photons sets[2];
  std::size_t blocks = 0, largest = 0;
  const auto report = TracePhotons(scene, options, [&](PhotonSet set, const Photons& block) {
    Photons& all = sets[set == PhotonSet::kCaustic];
    all.positions.insert(all.positions.end(), block.positions.begin(), block.positions.end());
    all.powers.insert(all.powers.end(), block.powers.begin(), block.powers.end());
    ++blocks, largest = std::max(largest, block.size());
    return absl::OkStatus();
  });
  ASSERT_TRUE(report.ok()) << report.status();
  const auto whole = TracePhotons(scene, options);
  ASSERT_TRUE(whole.ok());
  EXPECT_EQ(sets[0].positions, whole->indirect.positions);
  EXPECT_EQ(sets[1].positions, whole->caustic.positions);
  EXPECT_FLOAT_EQ(sets[1].powers[7] / static_cast<float>(report->caustic.paths),
                  whole->caustic.powers[7]);
  EXPECT_GT(blocks, 5u);
  EXPECT_LT(largest, 20'000u);
  const auto failed = TracePhotons(scene, options, [](PhotonSet, const Photons&) {
    return absl::ResourceExhaustedError("disk full");
  });
  EXPECT_EQ(failed.status().message(), "disk full");
}

/// A floor under a lamp and a horizontal sheet in between that faces it.
Scene MakeLampOverSheet() {
  Scene scene = MakeLampOverFloor(50, 0.1f);
  scene.materials.push_back(
      {.name = "sheet", .surface = Surface::kPane, .reflectance = {}, .ior = 1.5f});
  AddQuad({-10, 0.5f, 10}, {10, 0.5f, 10}, {10, 0.5f, -10}, {-10, 0.5f, -10}, 2, scene.mesh);
  // A second floor over it all, which the sheet reflects to.
  AddQuad({-10, 2, -10}, {10, 2, -10}, {10, 2, 10}, {-10, 2, 10}, 0, scene.mesh);
  return scene;
}

// What passes a pane is direct light; what it reflects belongs to the indirect set, and panes alone
// make no caustic set.
TEST(PhotonTracer, PanesMakeNoCaustics) {
  const Scene scene = MakeLampOverSheet();
  const TracedPhotons photons = MustTrace(scene, {.indirect_photons = 100'000, .seed = 11});
  const EnergyBalance& energy = photons.report.energy;
  EXPECT_EQ(photons.caustic.size(), 0u);
  EXPECT_EQ(photons.report.caustic.paths, 0u);
  EXPECT_EQ(energy.caustic[0], 0);
  // Lambertian light: the share 2 cos dcos of it passes.
  double passed = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto cosine = static_cast<float>((i + 0.5) / 1000);
    passed += 2 * cosine * SplitAtPane(cosine, 1.5f, {1, 1, 1}).passed.r / 1000;
  }
  EXPECT_NEAR(energy.direct[0], passed * energy.emitted[0], 0.01 * energy.emitted[0]);
  // The ceiling above the lamp has what the sheet reflected, and a quarter of the rest at most.
  double near_lamp = 0;
  for (std::size_t i = 0; i < photons.indirect.size(); ++i) {
    if (photons.indirect.position(i).y > 1.9f) near_lamp += photons.indirect.powers[3 * i];
  }
  EXPECT_GT(near_lamp, (1 - passed) * energy.emitted[0]);
}

// With a sphere of glass in the same scene, what a pane reflects into it is a caustic.
TEST(PhotonTracer, GlassBesidePanesMakesCaustics) {
  Scene scene = MakeLampOverSheet();
  scene.materials.push_back(
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f});
  scene.spheres = {{.center = {0.5f, 1.5f, 0}, .radius = 0.3f, .material = 3}};  // above the lamp
  const TracedPhotons photons =
      MustTrace(scene, {.indirect_photons = 200'000, .caustic_photons = 2'000, .seed = 12});
  ASSERT_GE(photons.caustic.size(), 2'000u);
  const double targeted = photons.report.caustic.stored[0];
  EXPECT_NEAR(targeted, photons.report.energy.caustic[0], 0.1 * targeted);

  // Lit by both the lamp and the sheet, neither by a few bright photons: both are aimed at.
  scene.spheres[0].center = {0.4f, 0.75f, 0};
  scene.spheres[0].radius = 0.15f;
  const TracedPhotons both =
      MustTrace(scene, {.indirect_photons = 0, .caustic_photons = 100'000, .seed = 12});
  std::vector<float> powers = both.caustic.powers;
  std::ranges::sort(powers);
  EXPECT_LT(powers.back(), 10 * powers[powers.size() / 2]);
}

// The floor under a mirror whose vertices all have the normal N: the lamp at height 3 gives
// L A cos_lamp (d.N) / d^2, as the path tracer has it.
TEST(PhotonTracer, StoresIrradianceAboutTheShadingNormal) {
  constexpr float kSide = 0.1f, kRadiance = 50;
  Scene scene = MakeLampUnderMirror(kRadiance, kSide);
  const Vec3 normal = Normalize({-0.6f, 1, 0});
  scene.mesh.normals.assign(scene.mesh.vertices.size(), Vec3{});
  for (int vertex = 0; vertex < 4; ++vertex) scene.mesh.normals[vertex] = normal;
  const TracedPhotons photons =
      MustTrace(scene, {.indirect_photons = 0, .caustic_photons = 1'500'000, .seed = 13});
  for (const float x : {-1.5f, 1.5f}) {
    const Vec3 to_lamp = Normalize({-x, 3, 0});
    const double expected =
        kRadiance * kSide * kSide * (3 / std::sqrt(9 + x * x)) * Dot(to_lamp, normal) / (9 + x * x);
    EXPECT_NEAR(Irradiance(photons.caustic, {x, 0, 0}, 0.4f), expected, 0.02 * expected) << x;
  }
}

TEST(PhotonTracer, RefusesWhatStoresNothing) {
  const auto code = [](const Scene& scene, const PhotonTraceOptions& options) {
    return TracePhotons(MustIntersect(scene), options).status().code();
  };
  EXPECT_EQ(code(MakeCornell(), {.indirect_photons = 0, .caustic_photons = 0}),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(MakeCornell(), {.max_bounces = 0}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(MakeFurnace(0.5f, 0), {}), absl::StatusCode::kFailedPrecondition);
  // One bounce off black walls: all light is direct.
  EXPECT_EQ(code(MakeFurnace(0, 1), {}), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace treelight::client
