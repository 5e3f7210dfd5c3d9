#include "client/trace/targets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>

#include "client/scenes/vector.h"
#include "client/trace/sampling.h"

namespace treelight::client {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

/// Groups are joined where their spheres have more than this share of the cross-section of one
/// sphere around both.
constexpr float kWorthSplitting = 0.8f;

/// Spheres are this much larger than what they hold, for the rounding of it all.
constexpr float kSlack = 1 + 1e-4f;

/// A triangle, or a sphere around its only corner.
struct Shape {
  std::array<Vec3, 3> corners;
  float radius = 0;
};

Vec3 Middle(const Shape& shape) {
  return (1.0f / 3) * (shape.corners[0] + shape.corners[1] + shape.corners[2]);
}

Targets::Bound BoundOf(std::span<const Shape> shapes) {
  Vec3 low{INFINITY, INFINITY, INFINITY}, high = -low;
  for (const Shape& shape : shapes) {
    for (const Vec3& c : shape.corners) {
      const float r = shape.radius;
      low = {std::min(low.x, c.x - r), std::min(low.y, c.y - r), std::min(low.z, c.z - r)};
      high = {std::max(high.x, c.x + r), std::max(high.y, c.y + r), std::max(high.z, c.z + r)};
    }
  }
  Targets::Bound bound{0.5f * (low + high), 0};
  for (const Shape& shape : shapes) {
    for (const Vec3& c : shape.corners)
      bound.radius = std::max(bound.radius, Length(c - bound.center) + shape.radius);
  }
  bound.radius = std::max(bound.radius * kSlack, std::numeric_limits<float>::min());
  return bound;
}

float CrossSection(std::span<const Targets::Bound> bounds) {
  float sum = 0;
  for (const auto& [center, radius] : bounds) sum += radius * radius;
  return sum;
}

/// At most `max_count` spheres around `shapes`, which it sorts.
std::vector<Targets::Bound> Split(std::span<Shape> shapes, std::size_t max_count) {
  const Targets::Bound whole = BoundOf(shapes);
  if (shapes.size() < 2 || max_count < 2) return {whole};

  Vec3 low{INFINITY, INFINITY, INFINITY}, high = -low;
  for (const Shape& shape : shapes) {
    const Vec3 c = Middle(shape);
    low = {std::min(low.x, c.x), std::min(low.y, c.y), std::min(low.z, c.z)};
    high = {std::max(high.x, c.x), std::max(high.y, c.y), std::max(high.z, c.z)};
  }
  const Vec3 size = high - low;
  float Vec3::*axis = &Vec3::x;
  if (size.y > size.*axis) axis = &Vec3::y;
  if (size.z > size.*axis) axis = &Vec3::z;
  const auto middle = std::partition(shapes.begin(), shapes.end(), [&](const Shape& shape) {
    return Middle(shape).*axis < 0.5f * (low.*axis + high.*axis);
  });
  if (middle == shapes.begin() || middle == shapes.end()) return {whole};

  const auto left_size = static_cast<std::size_t>(middle - shapes.begin());
  std::vector<Targets::Bound> parts = Split(shapes.first(left_size), max_count / 2);
  const auto right = Split(shapes.subspan(left_size), max_count - max_count / 2);
  parts.insert(parts.end(), right.begin(), right.end());
  if (CrossSection(parts) > kWorthSplitting * CrossSection({&whole, 1})) return {whole};
  return parts;
}

/// The cone from a light point that just holds a bound.
struct Cone {
  Vec3 axis;
  float squared_sine = 0;  // of its half angle
  float height = 0;        // 1 - the cosine; 0: the point is inside the bound
  float weight = 0;        // w_i, before it is normalised
};

Cone ConeTowards(const LightPoint& light, const Targets::Bound& bound) {
  const Vec3 path = bound.center - light.position;
  const float squared_distance = Dot(path, path);
  const float squared_radius = bound.radius * bound.radius;
  if (squared_distance <= squared_radius) return {.axis = {}, .weight = 1};
  Cone cone{.axis = Normalize(path), .squared_sine = squared_radius / squared_distance};
  const float cosine = std::sqrt(1 - cone.squared_sine);
  cone.height = cone.squared_sine / (1 + cosine);

  // The direction in the cone that is nearest to where the light is strongest.
  const Vec3& strongest = light.point == nullptr ? light.normal : light.point->direction;
  const float cos_axis = std::clamp(Dot(cone.axis, strongest), -1.0f, 1.0f);
  Vec3 best = strongest;
  if (cos_axis < cosine) {
    const Vec3 across = strongest - cos_axis * cone.axis;
    const float length = Length(across);
    best = length > 0 ? cosine * cone.axis + (std::sqrt(cone.squared_sine) / length) * across
                      : cone.axis;
  }
  cone.weight = 2 * kPi * cone.height * DirectionDensity(light, best);
  return cone;
}

bool IsInside(const Cone& cone, const Vec3& direction) {
  const Vec3 across = Cross(cone.axis, direction);
  return Dot(cone.axis, direction) > 0 && Dot(across, across) < cone.squared_sine;
}

/// q_i of a direction.
float Density(const Cone& cone, const LightPoint& light, const Vec3& direction, bool chosen) {
  if (cone.height == 0) return DirectionDensity(light, direction);
  return chosen || IsInside(cone, direction) ? 1 / (2 * kPi * cone.height) : 0;
}

}  // namespace

bool MakesCaustics(const Material& material) {
  switch (material.surface) {
    case Surface::kDiffuse:
    case Surface::kPane:
      return false;
    case Surface::kGlossy:
      return MaxChannel(material.specular) > 0;
    case Surface::kMirror:
      return MaxChannel(material.reflectance) > 0;
    case Surface::kDielectric:
      return true;
  }
  return false;
}

Targets::Targets(const Scene& scene) {
  std::vector<Shape> shapes;
  bool caustics = false;
  const auto is_target = [&](std::uint32_t material_index) {
    const Material& material = scene.materials[material_index];
    caustics = caustics || MakesCaustics(material);
    return MakesCaustics(material) || material.surface == Surface::kPane;
  };
  for (std::size_t i = 0; i < scene.mesh.corners.size(); ++i) {
    if (!is_target(scene.mesh.materials[i])) continue;
    const auto& [a, b, c] = scene.mesh.corners[i];
    shapes.push_back({{scene.mesh.vertices[a], scene.mesh.vertices[b], scene.mesh.vertices[c]}});
  }
  for (const Sphere& sphere : scene.spheres) {
    if (is_target(sphere.material))
      shapes.push_back({{sphere.center, sphere.center, sphere.center}, sphere.radius});
  }
  if (caustics) bounds_ = Split(shapes, kMaxTargets);
}

Emission SampleEmissionTowards(const Targets& targets, const Lights& lights, RandomStream& random) {
  const double u = random.FineUniform();
  const float v = random.Uniform();
  const float choice = random.Uniform();
  const float s = random.Uniform(), t = random.Uniform();
  const LightPoint light = lights.Sample(u, v);

  std::array<Cone, Targets::kMaxTargets> storage;
  const std::span cones = std::span(storage).first(targets.bounds().size());
  float sum = 0;
  for (std::size_t i = 0; i < cones.size(); ++i) {
    cones[i] = ConeTowards(light, targets.bounds()[i]);
    sum += cones[i].weight;
  }
  const float defensive = sum > 0 ? kDefensiveShare : 1;

  // One of the densities, and a direction by it.
  const Cone* chosen = nullptr;  // null: p0
  float left = (choice - defensive) / (1 - defensive) * sum;
  if (choice >= defensive) {
    for (const Cone& cone : cones) {
      if (!(cone.weight > 0)) continue;
      chosen = &cone;
      left -= cone.weight;
      if (left < 0) break;
    }
  }
  const Vec3 direction = chosen == nullptr || chosen->height == 0
                             ? SampleDirection(light, s, t)
                             : ConeDirection(chosen->axis, chosen->height, s, t);

  float density = defensive * DirectionDensity(light, direction);
  for (const Cone& cone : cones) {
    if (!(cone.weight > 0)) continue;
    density +=
        (1 - defensive) * (cone.weight / sum) * Density(cone, light, direction, &cone == chosen);
  }
  const Rgb power = density > 0 ? (1 / density) * PowerTowards(light, direction) : Rgb{};
  return {.ray = {light.position, direction}, .power = power};
}

}  // namespace treelight::client
