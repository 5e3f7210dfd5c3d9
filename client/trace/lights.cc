#include "client/trace/lights.h"

#include <algorithm>
#include <numbers>

#include "client/scenes/vector.h"
#include "client/trace/sampling.h"

namespace treelight::client {
namespace {

float ChannelSum(const Rgb& c) { return c.r + c.g + c.b; }

}  // namespace

Lights::Lights(const Scene& scene) {
  for (std::size_t i = 0; i < scene.mesh.corners.size(); ++i) {
    const Rgb& emission = scene.materials[scene.mesh.materials[i]].emission;
    const auto& [ia, ib, ic] = scene.mesh.corners[i];
    const Vec3 a = scene.mesh.vertices[ia], b = scene.mesh.vertices[ib],
               c = scene.mesh.vertices[ic];
    const Vec3 cross = Cross(b - a, c - a);
    const float area = Length(cross) / 2;
    if (!(MaxChannel(emission) > 0) || !(area > 0)) continue;
    const double first = weight_;
    weight_ += double{area} * ChannelSum(emission);
    power_ += (std::numbers::pi_v<float> * area) * emission;
    triangles_.push_back({a, b, c, Normalize(cross), emission, first, weight_});
  }
  for (Triangle& triangle : triangles_) triangle.first /= weight_, triangle.last /= weight_;
}

LightPoint Lights::Sample(float u, float v) const {
  const auto chosen = std::min(std::upper_bound(triangles_.begin(), triangles_.end(), double{u},
                                                [](double value, const Triangle& triangle) {
                                                  return value < triangle.last;
                                                }),
                               triangles_.end() - 1);
  // What is left of u within the triangle's share is uniform again.
  const double share = chosen->last - chosen->first;
  const auto rest = static_cast<float>(std::clamp((u - chosen->first) / share, 0.0, 1.0));
  const Vec3 point = TrianglePoint(chosen->a, chosen->b, chosen->c, rest, v);
  return {.position = OffsetFromSurface(point, chosen->normal),
          .normal = chosen->normal,
          .emission = chosen->emission,
          .density = static_cast<float>(ChannelSum(chosen->emission) / weight_)};
}

float Lights::Density(const Material& material) const {
  return static_cast<float>(ChannelSum(material.emission) / weight_);
}

std::optional<DirectLight> SampleDirectLight(const Intersector& intersector, const Lights& lights,
                                             const Hit& hit, float u, float v) {
  const LightPoint light = lights.Sample(u, v);
  const Vec3 origin = OffsetFromSurface(hit.position, hit.normal);
  const Vec3 path = light.position - origin;
  const float squared_distance = Dot(path, path);
  if (!(squared_distance > 0)) return std::nullopt;
  const Vec3 direction = Normalize(path);
  const float cos_surface = Dot(direction, hit.normal), cos_light = -Dot(direction, light.normal);
  if (cos_surface <= 0 || cos_light <= 0) return std::nullopt;
  if (intersector.Occluded(origin, light.position)) return std::nullopt;
  const float density = light.density * squared_distance / cos_light;
  return DirectLight{.irradiance = (cos_surface / density) * light.emission,
                     .density = density,
                     .scatter_density = cos_surface / std::numbers::pi_v<float>};
}

}  // namespace treelight::client
