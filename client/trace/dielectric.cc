#include "client/trace/dielectric.h"

#include <algorithm>
#include <cmath>

#include "client/scenes/vector.h"

namespace treelight::client {

Vec3 Reflect(const Vec3& direction, const Vec3& normal) {
  return Normalize(direction - (2 * Dot(direction, normal)) * normal);
}

DielectricSplit SplitAtDielectric(const Vec3& direction, const Vec3& normal, float ior_ratio) {
  DielectricSplit split;
  split.reflected = Reflect(direction, normal);
  const float cos_in = std::clamp(-Dot(direction, normal), 0.0f, 1.0f);
  const float squared_sin_out = ior_ratio * ior_ratio * (1 - cos_in * cos_in);
  if (squared_sin_out >= 1) return split;
  const float cos_out = std::sqrt(1 - squared_sin_out);

  // Amplitudes for light polarised across and along the plane of incidence; n = n_in / n_out.
  const float across = (ior_ratio * cos_in - cos_out) / (ior_ratio * cos_in + cos_out);
  const float along = (cos_in - ior_ratio * cos_out) / (cos_in + ior_ratio * cos_out);
  split.reflectance = (across * across + along * along) / 2;
  split.refracted = Normalize(ior_ratio * direction + (ior_ratio * cos_in - cos_out) * normal);
  return split;
}

}  // namespace treelight::client
