// Photons against the path tracer, and against photons that go the other way.
#include <cmath>
#include <numbers>

#include "client/render/path_tracer.h"
#include "client/scenes/vector.h"
#include "client/trace/lights.h"
#include "client/trace/photon_tracer.h"
#include "client/trace/random.h"
#include "client/trace/sampling.h"
#include "gtest/gtest.h"
#include "tests/test_scenes.h"
#include "tests/traced_photons.h"

namespace treelight::client {
namespace {

using ::treelight::testing::DirectionOf;
using ::treelight::testing::Imbalance;
using ::treelight::testing::MakeClosedBox;
using ::treelight::testing::MustIntersect;
using ::treelight::testing::MustTrace;

/// A box with a lamp that shines at its ceiling, over a coarse sphere of 8 x 4 facets with smooth
/// normals: the sphere has light from the walls alone.
Scene MakeCoarseSphere(Surface surface) {
  Scene scene = MakeClosedBox({.name = "grey", .reflectance = {0.6f, 0.6f, 0.6f}});
  scene.materials.push_back({.name = "lamp", .reflectance = {}, .emission = {10, 10, 10}});
  scene.materials.push_back({.name = "ball",
                             .surface = surface,
                             .reflectance = {0.5f, 0.5f, 0.5f},
                             .specular = {0.3f, 0.3f, 0.3f},
                             .exponent = 10});
  AddQuad({0.2f, 0.9f, 0.8f}, {0.8f, 0.9f, 0.8f}, {0.8f, 0.9f, 0.2f}, {0.2f, 0.9f, 0.2f}, 1,
          scene.mesh);
  Mesh& mesh = scene.mesh;
  mesh.normals.assign(mesh.vertices.size(), Vec3{});
  const auto point = [](int i, int j) {
    const double a = i * std::numbers::pi / 4, b = j * std::numbers::pi / 4;
    return Vec3{static_cast<float>(std::cos(a) * std::sin(b)), static_cast<float>(std::cos(b)),
                static_cast<float>(-std::sin(a) * std::sin(b))};
  };
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j < 4; ++j) {
      const Vec3 corners[4] = {point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)};
      const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
      for (const Vec3& n : corners) {
        mesh.vertices.push_back(Vec3{0.5f, 0.45f, 0.5f} + 0.3f * n);
        mesh.normals.push_back(n);
      }
      if (j < 3) mesh.corners.push_back({first, first + 1, first + 2}), mesh.materials.push_back(2);
      if (j > 0) mesh.corners.push_back({first, first + 2, first + 3}), mesh.materials.push_back(2);
    }
  }
  return scene;
}

/// Mean over the upper facets of the sphere of MakeCoarseSphere, and over the lower ones, of the
/// red irradiance.
struct SphereIrradiance {
  double upper = 0, lower = 0;
};

/// By photons. Counts those that were stored less than a facet's sagitta off the sphere.
SphereIrradiance ByPhotons(const Photons& photons, double area) {
  SphereIrradiance irradiance;
  for (std::size_t i = 0; i < photons.size(); ++i) {
    const Vec3 p = photons.position(i) - Vec3{0.5f, 0.45f, 0.5f};
    if (Length(p) < 0.31f)
      (p.y > 0 ? irradiance.upper : irradiance.lower) += photons.powers[3 * i] / (area / 2);
  }
  return irradiance;
}

/// By gathering radiance over the hemisphere, with camera paths.
SphereIrradiance ByPaths(const Intersector& intersector, double& area) {
  const Scene& scene = intersector.scene();
  const Lights lights(scene);
  SphereIrradiance irradiance;
  RandomStream random(14, RandomPurpose::kReferencePath, 0);
  area = 0;
  for (std::size_t i = 0; i < scene.mesh.corners.size(); ++i) {
    if (scene.mesh.materials[i] != 2) continue;
    const auto& [ia, ib, ic] = scene.mesh.corners[i];
    const Vec3 a = scene.mesh.vertices[ia], b = scene.mesh.vertices[ib],
               c = scene.mesh.vertices[ic];
    const Vec3 cross = Cross(b - a, c - a);
    const double facet = Length(cross) / 2;
    area += facet;
    constexpr int kSamples = 10'000;
    for (int s = 0; s < kSamples; ++s) {
      const float u = random.Uniform(), v = random.Uniform();
      const Ray ray{TrianglePoint(a, b, c, u, v) + 0.01f * Normalize(cross), -Normalize(cross)};
      const auto hit = intersector.Intersect(ray);
      if (!hit || hit->triangle != i) continue;
      const float x = random.Uniform(), y = random.Uniform();
      const Vec3 direction = CosineDirection(hit->shading_normal, x, y);
      if (Dot(direction, hit->normal) <= 0) continue;
      const PathSample path = TracePath(intersector, lights, LeaveSurface(*hit, direction), random);
      (hit->position.y > 0.45f ? irradiance.upper : irradiance.lower) +=
          std::numbers::pi * path.radiance.r * facet / kSamples;
    }
  }
  irradiance.upper /= area / 2, irradiance.lower /= area / 2;
  return irradiance;
}

// Both ways of light: photons that are stored on facets with smooth normals, and that are scattered
// by them, against the path tracer.
TEST(PhotonTracerAgreement, AgreesWithThePathTracerOnSmoothNormals) {
  for (const Surface surface : {Surface::kDiffuse, Surface::kGlossy}) {
    const Scene scene = MakeCoarseSphere(surface);
    double area = 0;
    const SphereIrradiance paths = ByPaths(MustIntersect(scene), area);
    EXPECT_NEAR(area, 4 * std::numbers::pi * 0.09, 0.15);
    TracedPhotons traced =
        MustTrace(scene, {.indirect_photons = 1'000'000, .caustic_photons = 100'000, .seed = 15});
    const SphereIrradiance photons = ByPhotons(traced.indirect, area),
                           caustic = ByPhotons(traced.caustic, area);
    EXPECT_NEAR(photons.upper + caustic.upper, paths.upper, 0.015 * paths.upper);
    EXPECT_NEAR(photons.lower + caustic.lower, paths.lower, 0.015 * paths.lower);
    // Normals alone move light about: what they take they give elsewhere.
    const EnergyBalance& energy = traced.report.energy;
    EXPECT_NE(energy.shading[0], 0);
    EXPECT_NEAR(Imbalance(energy)[0], 0, 1e-6 * energy.emitted[0]);
  }
}

/// A box of satin walls with a mirror, a glass sphere and a sheet, in which one of two black
/// patches of different size shines.
Scene MakeSwapScene(bool second_shines) {
  Scene scene = MakeClosedBox({.name = "satin",
                               .surface = Surface::kGlossy,
                               .reflectance = {0.5f, 0.5f, 0.5f},
                               .specular = {0.3f, 0.3f, 0.3f},
                               .exponent = 5});
  const float first = second_shines ? 0 : 1, second = second_shines ? 1 : 0;
  scene.materials.insert(
      scene.materials.end(),
      {{.name = "first", .reflectance = {}, .emission = {first, first, first}},
       {.name = "second", .reflectance = {}, .emission = {second, second, second}},
       {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f},
       {.name = "mirror", .surface = Surface::kMirror, .reflectance = {0.9f, 0.9f, 0.9f}},
       {.name = "sheet", .surface = Surface::kPane, .reflectance = {}, .ior = 1.5f}});
  AddQuad({0.1f, 0.95f, 0.1f}, {0.4f, 0.95f, 0.1f}, {0.4f, 0.95f, 0.4f}, {0.1f, 0.95f, 0.4f}, 1,
          scene.mesh);  // faces down
  AddQuad({0.4f, 0.05f, 0.95f}, {0.95f, 0.05f, 0.95f}, {0.95f, 0.05f, 0.4f}, {0.4f, 0.05f, 0.4f}, 2,
          scene.mesh);  // faces up
  AddQuad({0, 0.6f, 1}, {0.5f, 0.6f, 1}, {0.5f, 0.6f, 0}, {0, 0.6f, 0}, 5, scene.mesh);
  scene.spheres = {{.center = {0.5f, 0.4f, 0.5f}, .radius = 0.2f, .material = 3},
                   {.center = {0.8f, 0.75f, 0.5f}, .radius = 0.15f, .material = 4}};
  return scene;
}

// Helmholtz reciprocity of all of transport: patches of equal radiance send each other the same
// power, in each set.
TEST(PhotonTracerAgreement, IsReciprocal) {
  double indirect[2] = {}, caustic[2] = {};
  for (const bool second_shines : {false, true}) {
    const TracedPhotons traced =
        MustTrace(MakeSwapScene(second_shines),
                  {.indirect_photons = 1'500'000, .caustic_photons = 300'000, .seed = 16});
    const auto received = [&](const Photons& photons) {
      double power = 0;
      for (std::size_t i = 0; i < photons.size(); ++i) {
        const float y = photons.position(i).y, down = -DirectionOf(photons, i).y;
        if (second_shines ? y == 0.95f && down < 0 : y == 0.05f && down > 0)  // on its front
          power += photons.powers[3 * i];
      }
      return power;
    };
    indirect[second_shines] = received(traced.indirect);
    caustic[second_shines] = received(traced.caustic);
  }
  EXPECT_GT(caustic[0], 0.01 * indirect[0]);
  EXPECT_NEAR(indirect[0], indirect[1], 0.02 * indirect[1]);
  EXPECT_NEAR(caustic[0], caustic[1], 0.03 * caustic[1]);
}

}  // namespace
}  // namespace treelight::client
