#include "client/scenes/default_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/scenes/shapes.h"
#include "client/scenes/vector.h"

namespace treelight::client {
namespace {

constexpr float kFovDegrees = 40;
// Of the default light: its distance and its side, in radii of the scene.
constexpr float kLightDistance = 2.5f, kLightSide = 1;
constexpr float kLightRadiance = 10;  // W / unit^2 / sr

struct Bounds {
  Vec3 center;
  float radius = 0;  // of a ball that has all shapes inside
};

Bounds BoundsOf(const Scene& scene) {
  Box box;
  for (const Vec3& vertex : scene.mesh.vertices) box.Extend(vertex);
  for (const Sphere& sphere : scene.spheres) {
    const Vec3 r = {sphere.radius, sphere.radius, sphere.radius};
    box.Extend(sphere.center - r);
    box.Extend(sphere.center + r);
  }
  return {0.5f * (box.min + box.max), 0.5f * Length(box.max - box.min)};
}

}  // namespace

Camera MakeDefaultCamera(const Scene& scene) {
  const auto [center, radius] = BoundsOf(scene);
  const float half_angle = kFovDegrees / 2 * std::numbers::pi_v<float> / 180;
  const Vec3 direction = Normalize({0.45f, 0.35f, 1});
  return {.position = center + (radius / std::sin(half_angle)) * direction,
          .target = center,
          .vertical_fov_degrees = kFovDegrees};
}

bool HasLight(const Scene& scene) {
  return !scene.point_lights.empty() ||
         std::any_of(scene.mesh.materials.begin(), scene.mesh.materials.end(),
                     [&scene](std::uint32_t material) {
                       return MaxChannel(scene.materials[material].emission) > 0;
                     });
}

void AddDefaultLight(Scene& scene) {
  const auto [center, radius] = BoundsOf(scene);
  const Vec3 direction = Normalize({-0.6f, 1, 0.7f});
  Material material{.name = "default light", .reflectance = {}};
  material.emission = {kLightRadiance, kLightRadiance, kLightRadiance};
  scene.materials.push_back(material);
  AddRectangle(center + (kLightDistance * radius) * direction, -direction, kLightSide * radius,
               kLightSide * radius, static_cast<std::uint32_t>(scene.materials.size() - 1),
               scene.mesh);
}

}  // namespace treelight::client
