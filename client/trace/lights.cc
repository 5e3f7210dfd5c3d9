#include "client/trace/lights.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/scenes/vector.h"
#include "client/trace/sampling.h"

namespace treelight::client {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

double ChannelSum(const Rgb& c) { return double{c.r} + c.g + c.b; }

/// Cosines of the angles from the axis at which the intensity begins to fall and at which it is 0.
struct Cone {
  float cos_begin, cos_rim;
};

Cone ConeOf(const PointLight& light) {
  const auto cosine = [](float degrees) {
    return degrees >= 180 ? -1.0f : std::cos(degrees / 180 * kPi);
  };
  return {cosine(light.falloff_begin_degrees), cosine(light.cone_degrees)};
}

/// The s in [0, 1] at which the integral of 3 s^2 - 2 s^3 from 0, s^3 - s^4 / 2, is `share` of that
/// to 1.
float InvertFalloff(float share) {
  float low = 0, high = 1;
  for (int i = 0; i < 24; ++i) {  // as many bits as `share` has
    const float s = (low + high) / 2;
    ((2 - s) * s * s * s < share ? low : high) = s;
  }
  return (low + high) / 2;
}

/// Draws a direction in proportion to the intensity: uniform by the cosine inside, and in the
/// falloff, which has half the power of as much full light, by its integral.
Vec3 SampleIntensity(const PointLight& light, float s, float t) {
  const auto [cos_begin, cos_rim] = ConeOf(light);
  const float inside = 1 - cos_begin, falloff = (cos_begin - cos_rim) / 2;
  const float place = s * (inside + falloff);
  const float cosine =
      place < inside || !(falloff > 0)
          ? 1 - place
          : cos_rim + (cos_begin - cos_rim) * InvertFalloff(1 - (place - inside) / falloff);
  return DirectionAround(light.direction, std::max(cosine, -1.0f), t);
}

}  // namespace

Rgb IntensityTowards(const PointLight& light, const Vec3& direction) {
  const auto [cos_begin, cos_rim] = ConeOf(light);
  const float cosine = Dot(light.direction, direction);
  if (cosine >= cos_begin || cos_begin <= -1) return light.intensity;
  if (cosine <= cos_rim) return {};
  const float s = (cosine - cos_rim) / (cos_begin - cos_rim);
  return (s * s * (3 - 2 * s)) * light.intensity;
}

Rgb PowerOf(const PointLight& light) {
  const auto [cos_begin, cos_rim] = ConeOf(light);
  return (kPi * (2 - cos_begin - cos_rim)) * light.intensity;
}

Lights::Lights(const Scene& scene) {
  const auto add = [this](Light light, const Rgb& power) {
    if (!(ChannelSum(power) > 0)) return;
    light.first = weight_;
    weight_ += ChannelSum(power);
    light.last = weight_;
    power_ += power;
    can_be_met_ = can_be_met_ || light.point == nullptr;
    lights_.push_back(light);
  };
  for (std::size_t i = 0; i < scene.mesh.corners.size(); ++i) {
    const Rgb& emission = scene.materials[scene.mesh.materials[i]].emission;
    if (!(MaxChannel(emission) > 0)) continue;
    const auto& [ia, ib, ic] = scene.mesh.corners[i];
    const Vec3 a = scene.mesh.vertices[ia], b = scene.mesh.vertices[ib],
               c = scene.mesh.vertices[ic];
    const Vec3 cross = Cross(b - a, c - a);
    const float area = Length(cross) / 2;
    if (!(area > 0)) continue;
    add({.a = a, .b = b, .c = c, .normal = Normalize(cross), .emission = emission, .area = area},
        (kPi * area) * emission);
  }
  for (const PointLight& light : scene.point_lights) {
    add({.point = &light, .a = light.position, .b = {}, .c = {}, .normal = {}, .emission = {}},
        PowerOf(light));
  }
  for (Light& light : lights_) light.first /= weight_, light.last /= weight_;
}

LightPoint Lights::Sample(double u, float v) const {
  const auto chosen = std::min(
      std::upper_bound(lights_.begin(), lights_.end(), u,
                       [](double value, const Light& light) { return value < light.last; }),
      lights_.end() - 1);
  const double share = chosen->last - chosen->first;
  LightPoint point{.position = chosen->a,
                   .probability = static_cast<float>(share),
                   .point = chosen->point,
                   .normal = chosen->normal,
                   .emission = chosen->emission};
  if (chosen->point != nullptr) return point;
  // What is left of u within the triangle's share is uniform again.
  const auto rest = static_cast<float>(std::clamp((u - chosen->first) / share, 0.0, 1.0));
  point.position =
      OffsetFromSurface(TrianglePoint(chosen->a, chosen->b, chosen->c, rest, v), chosen->normal);
  point.density = point.probability / chosen->area;
  return point;
}

float Lights::Density(const Hit& hit, const Vec3& direction, float distance) const {
  // Probability of the triangle over its area.
  const auto density = static_cast<float>(kPi * ChannelSum(hit.material->emission) / weight_);
  return density * distance * distance / std::fabs(Dot(direction, hit.normal));
}

float DirectionDensity(const LightPoint& light, const Vec3& direction) {
  if (light.point == nullptr) return std::max(0.0f, Dot(direction, light.normal)) / kPi;
  return MaxChannel(IntensityTowards(*light.point, direction)) / MaxChannel(PowerOf(*light.point));
}

Vec3 SampleDirection(const LightPoint& light, float u, float v) {
  return light.point == nullptr ? CosineDirection(light.normal, u, v)
                                : SampleIntensity(*light.point, u, v);
}

Rgb PowerTowards(const LightPoint& light, const Vec3& direction) {
  if (light.point == nullptr)
    return (std::max(0.0f, Dot(direction, light.normal)) / light.density) * light.emission;
  return (1 / light.probability) * IntensityTowards(*light.point, direction);
}

Emission SampleEmission(const Lights& lights, double u, float v, float s, float t) {
  const LightPoint light = lights.Sample(u, v);
  // PowerTowards / DirectionDensity, in which the direction cancels.
  return {.ray = {light.position, SampleDirection(light, s, t)},
          .power = light.point == nullptr ? (kPi / light.density) * light.emission
                                          : (1 / light.probability) * PowerOf(*light.point)};
}

std::optional<UnshadowedLight> SampleUnshadowedLight(const Lights& lights, const Hit& hit, float u,
                                                     float v) {
  const LightPoint light = lights.Sample(u, v);
  const Vec3 origin = OffsetFromSurface(hit.position, hit.normal);
  const Vec3 path = light.position - origin;
  const float squared_distance = Dot(path, path);
  if (!(squared_distance > 0)) return std::nullopt;
  DirectLight direct{.direction = Normalize(path), .irradiance = {}};
  if (Dot(direct.direction, hit.normal) <= 0 || Dot(direct.direction, hit.shading_normal) <= 0)
    return std::nullopt;
  if (light.point != nullptr) {
    direct.irradiance = (1 / (squared_distance * light.probability)) *
                        IntensityTowards(*light.point, -direct.direction);
  } else {
    const float cos_light = -Dot(direct.direction, light.normal);
    if (cos_light <= 0) return std::nullopt;
    direct.density = light.density * squared_distance / cos_light;
    direct.irradiance = (1 / direct.density) * light.emission;
  }
  if (!(MaxChannel(direct.irradiance) > 0)) return std::nullopt;
  return UnshadowedLight{.light = direct, .shadow = {origin, light.position}};
}

std::optional<DirectLight> SampleDirectLight(const Intersector& intersector, const Lights& lights,
                                             const Hit& hit, float u, float v) {
  const auto sampled = SampleUnshadowedLight(lights, hit, u, v);
  if (!sampled) return std::nullopt;
  DirectLight direct = sampled->light;
  direct.irradiance =
      direct.irradiance * intersector.Transmittance(sampled->shadow.from, sampled->shadow.to);
  if (!(MaxChannel(direct.irradiance) > 0)) return std::nullopt;
  return direct;
}

}  // namespace treelight::client
