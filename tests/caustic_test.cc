#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "client/trace/photon_tracer.h"
#include "client/trace/targets.h"
#include "gtest/gtest.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MustIntersect;

TracedPhotons MustTraceCaustics(const Scene& scene, std::uint64_t count, CausticEmission emission,
                                std::uint32_t max_bounces = 64) {
  auto photons = TracePhotons(MustIntersect(scene), {.indirect_photons = 0,
                                                     .caustic_photons = count,
                                                     .seed = 21,
                                                     .max_bounces = max_bounces,
                                                     .caustic_emission = emission});
  EXPECT_TRUE(photons.ok()) << photons.status();
  return *std::move(photons);
}

/// The Cornell box with a light of another kind.
Scene MakeCornellLitBy(const std::string& light) {
  Scene scene = MakeCornell();
  if (light == "area") return scene;
  scene.materials[3].emission = {};
  const Vec3 place{-0.3f, 1.8f, 0.3f};
  if (light == "point") {
    scene.point_lights = {{.position = place, .intensity = {1, 1, 1}}};
  } else if (light == "spot") {  // its rim cuts the mirror sphere in two
    scene.point_lights = {{.position = place,
                           .intensity = {3, 3, 3},
                           .direction = Normalize({0.4f, -1, 0}),
                           .cone_degrees = 25,
                           .falloff_begin_degrees = 5}};
  } else {  // a lamp inside of the glass
    scene.point_lights = {{.position = {0.42f, 0.5f, 0.28f}, .intensity = {1, 1, 1}}};
  }
  return scene;
}

/// Red power in each cell of a 6 x 6 grid over the floor of the Cornell box, and all elsewhere.
std::array<double, 37> FloorPower(const Photons& photons) {
  std::array<double, 37> power{};
  for (std::size_t i = 0; i < photons.size(); ++i) {
    const Vec3 p = photons.position(i);
    const auto cell = [](float x) { return std::clamp(static_cast<int>(3 * (x + 1)), 0, 5); };
    power[p.y == 0 ? 6 * cell(p.x) + cell(p.z) : 36] += photons.powers[3 * i];
  }
  return power;
}

// Aiming changes how often light is followed, not how much of it there is: in all, and place by
// place.
TEST(CausticEmission, TargetedPowerIsThatOfUniformEmission) {
  for (const std::string light : {"area", "point", "spot", "inside"}) {
    const Scene scene = MakeCornellLitBy(light);
    const TracedPhotons targeted = MustTraceCaustics(scene, 150'000, CausticEmission::kTargeted),
                        uniform = MustTraceCaustics(scene, 150'000, CausticEmission::kUniform);
    const double expected = uniform.report.caustic.stored[0];
    EXPECT_NEAR(targeted.report.caustic.stored[0], expected, 0.01 * expected) << light;
    const auto a = FloorPower(targeted.caustic), b = FloorPower(uniform.caustic);
    for (std::size_t cell = 0; cell < a.size(); ++cell)
      EXPECT_NEAR(a[cell], b[cell], 0.008 * expected) << light << ", cell " << cell;
  }
}

TEST(CausticEmission, TargetingSavesPaths) {
  const auto paths = [](const Scene& scene, std::uint64_t count, CausticEmission emission) {
    return MustTraceCaustics(scene, count, emission).report.caustic.paths;
  };
  const Scene scene = MakeCornell();
  EXPECT_LT(4 * paths(scene, 20'000, CausticEmission::kTargeted),
            paths(scene, 20'000, CausticEmission::kUniform));
  // A pea of glass instead of the spheres.
  Scene pea = scene;
  pea.spheres = {{.center = {0.42f, 0.04f, 0.28f}, .radius = 0.03f, .material = 5}};
  EXPECT_LT(300 * paths(pea, 200, CausticEmission::kTargeted),
            paths(pea, 200, CausticEmission::kUniform));
}

// Photons of like power make a smooth map: no rare one may carry much more than the rest.
TEST(CausticEmission, NoPhotonIsMuchBrighterThanTheRest) {
  for (const std::string light : {"area", "point", "spot"}) {
    const TracedPhotons photons =
        MustTraceCaustics(MakeCornellLitBy(light), 100'000, CausticEmission::kTargeted);
    std::vector<float> powers;
    for (std::size_t i = 0; i < photons.caustic.size(); ++i)
      powers.push_back(photons.caustic.powers[3 * i + 1]);
    std::ranges::sort(powers);
    const float median = powers[powers.size() / 2];
    EXPECT_LT(powers.back(), 8 * median) << light;
  }
}

TEST(Targets, HoldEverySpecularShape) {
  Scene scene = MakeCornell();
  scene.spheres.clear();
  Mesh& mesh = scene.mesh;
  const std::size_t first_vertex = mesh.vertices.size();
  for (int i = 0; i < 60; ++i) {  // a ring of mirrors, which one sphere would hold badly
    const auto at = [](int step, float y) {
      const double a = step * std::numbers::pi / 30;
      return Vec3{static_cast<float>(std::cos(a)), y, static_cast<float>(std::sin(a))};
    };
    AddQuad(at(i, 0), at(i + 1, 0), at(i + 1, 0.1f), at(i, 0.1f), 4, mesh);
  }
  const Targets targets(scene);
  EXPECT_GT(targets.bounds().size(), 8u);
  EXPECT_LE(targets.bounds().size(), Targets::kMaxTargets);
  for (std::size_t v = first_vertex; v < mesh.vertices.size(); ++v) {
    EXPECT_TRUE(std::ranges::any_of(targets.bounds(), [&](const Targets::Bound& bound) {
      return Length(mesh.vertices[v] - bound.center) <= bound.radius;
    })) << v;
  }
  double cross_section = 0;
  for (const auto& bound : targets.bounds()) cross_section += double{bound.radius} * bound.radius;
  EXPECT_LT(cross_section, 0.6);
}

TEST(Targets, AreNoneWithoutCaustics) {
  Scene scene = MakeCornell();
  scene.spheres.clear();
  EXPECT_TRUE(Targets(scene).empty());
  scene.materials[0].surface = Surface::kPane;
  EXPECT_TRUE(Targets(scene).empty());
  scene.materials[1].surface = Surface::kGlossy;
  EXPECT_TRUE(Targets(scene).empty());  // its lobe is black
  scene.materials[1].specular = {0.1f, 0, 0};
  EXPECT_FALSE(Targets(scene).empty());
}

/// A mirror cylinder of radius 1 and height 2 about the y axis that stands on a floor, of many
/// facets with smooth normals, and a lamp at (-distance, 1, 0).
Scene MakeMirrorCylinder(float distance) {
  constexpr int kFacets = 360;
  Scene scene;
  scene.materials = {{.name = "floor", .reflectance = {0.5f, 0.5f, 0.5f}},
                     {.name = "mirror", .surface = Surface::kMirror, .reflectance = {1, 1, 1}}};
  AddQuad({-2, 0, 2}, {2, 0, 2}, {2, 0, -2}, {-2, 0, -2}, 0, scene.mesh);
  scene.mesh.normals.assign(4, {});
  const auto out = [](int i) {
    const double a = 2 * std::numbers::pi * (i % kFacets) / kFacets;
    return Vec3{static_cast<float>(std::cos(a)), 0, static_cast<float>(std::sin(a))};
  };
  for (int i = 0; i < kFacets; ++i) {
    const Vec3 up{0, 2, 0}, a = out(i), b = out(i + 1);
    AddQuad(a, b, b + up, a + up, 1, scene.mesh);
    std::ranges::copy(std::array{a, b, b, a}, scene.mesh.normals.end() - 4);
  }
  // It shines at the wall opposite, so that what comes back meets the floor about the cusp.
  scene.point_lights = {{.position = {-distance, 1, 0},
                         .intensity = {1, 1, 1},
                         .direction = Normalize({1, -0.4f, 0}),
                         .cone_degrees = 15,
                         .falloff_begin_degrees = 15}};
  return scene;
}

/// Density of power along the x axis, in a strip of |z| < 0.001: where it peaks. (The two branches
/// that meet in the cusp leave a strip of half width w some w^(2/3) behind it.)
double PeakOnAxis(const Photons& photons) {
  constexpr int kBins = 200;  // of x in (-1, 1)
  std::array<double, kBins> power{};
  for (std::size_t i = 0; i < photons.size(); ++i) {
    const Vec3 p = photons.position(i);
    if (p.y != 0 || std::fabs(p.z) > 0.001f || std::fabs(p.x) > 0.98f) continue;
    power[static_cast<int>((p.x + 1) * kBins / 2)] += photons.powers[3 * i];
  }
  const auto peak = std::ranges::max_element(power) - power.begin();
  return -1 + (2 * peak + 1.0) / kBins;
}

// Seen from above, rays from a point at distance u of the wall opposite meet at v behind it,
// 1 / u + 1 / v = 2 / R: the cusp of the caustic. With the lamp on the wall, u = 2 R, the caustic
// is a cardioid and the cusp at R / 3 from the middle; with the lamp far away it is a nephroid, R
// / 2.
TEST(Caustic, OfAMirrorCylinderHasItsCuspWhereGeometrySays) {
  for (const float distance : {0.3f, 0.6f, 0.999f}) {
    const TracedPhotons photons = MustTraceCaustics(MakeMirrorCylinder(distance), 600'000,
                                                    CausticEmission::kTargeted, /*max_bounces=*/2);
    const double u = 1 + distance, v = 1 / (2 - 1 / u);
    EXPECT_NEAR(PeakOnAxis(photons.caustic), 1 - v, 0.015) << distance;
  }
}

/// Parallel light, that of a lamp far away through the open side of half a cylinder.
TEST(Caustic, OfParallelLightIsTheNephroid) {
  Scene scene = MakeMirrorCylinder(1);
  Mesh& mesh = scene.mesh;
  // The half that faces the lamp is taken away.
  for (std::size_t i = mesh.corners.size(); i-- > 2;) {
    if (mesh.vertices[mesh.corners[i][0]].x > 0) continue;
    mesh.corners.erase(mesh.corners.begin() + static_cast<std::ptrdiff_t>(i));
    mesh.materials.erase(mesh.materials.begin() + static_cast<std::ptrdiff_t>(i));
  }
  const Vec3 lamp{-1000, 500, 0};
  scene.point_lights[0] = {.position = lamp, .intensity = {1, 1, 1}};
  const TracedPhotons photons =
      MustTraceCaustics(scene, 500'000, CausticEmission::kTargeted, /*max_bounces=*/2);
  EXPECT_NEAR(PeakOnAxis(photons.caustic), 0.5, 0.015);
}

}  // namespace
}  // namespace treelight::client
