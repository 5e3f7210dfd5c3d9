#include "client/trace/dielectric.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/scenes/vector.h"

namespace treelight::client {

Vec3 Reflect(const Vec3& direction, const Vec3& normal) {
  return Normalize(direction - (2 * Dot(direction, normal)) * normal);
}

namespace {

/// Reflectance of a smooth boundary for unpolarised light by Fresnel's equations; n = n_in / n_out.
float FresnelReflectance(float n, float cos_in, float cos_out) {
  // Amplitudes for light polarised across and along the plane of incidence.
  const float across = (n * cos_in - cos_out) / (n * cos_in + cos_out);
  const float along = (cos_in - n * cos_out) / (cos_in + n * cos_out);
  return (across * across + along * along) / 2;
}

}  // namespace

DielectricSplit SplitAtDielectric(const Vec3& direction, const Vec3& normal, float ior_ratio) {
  DielectricSplit split;
  split.reflected = Reflect(direction, normal);
  const float cos_in = std::clamp(-Dot(direction, normal), 0.0f, 1.0f);
  const float squared_sin_out = ior_ratio * ior_ratio * (1 - cos_in * cos_in);
  if (squared_sin_out >= 1) return split;
  split.radiance_scale = ior_ratio * ior_ratio;
  const float cos_out = std::sqrt(1 - squared_sin_out);
  split.reflectance = FresnelReflectance(ior_ratio, cos_in, cos_out);
  split.refracted = Normalize(ior_ratio * direction + (ior_ratio * cos_in - cos_out) * normal);
  return split;
}

PaneSplit SplitAtPane(float cosine, float ior, const Rgb& transmittance) {
  const float squared_sin = (1 - cosine * cosine) / (ior * ior);
  if (squared_sin >= 1) return {.reflected = {1, 1, 1}, .passed = {}};
  const float r = FresnelReflectance(1 / ior, cosine, std::sqrt(1 - squared_sin));
  if (r >= 1) return {.reflected = {1, 1, 1}, .passed = {}};
  const auto channel = [r](float t) {
    const float all_orders = (1 - r) * (1 - r) / (1 - r * r * t * t);
    return std::pair{r + all_orders * r * t * t, all_orders * t};
  };
  const auto [red, passed_red] = channel(transmittance.r);
  const auto [green, passed_green] = channel(transmittance.g);
  const auto [blue, passed_blue] = channel(transmittance.b);
  return {.reflected = {red, green, blue}, .passed = {passed_red, passed_green, passed_blue}};
}

}  // namespace treelight::client
