#include "client/trace/sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/scenes/vector.h"

namespace treelight::client {

Vec3 CosineDirection(const Vec3& normal, float u, float v) {
  // A point of the unit disc, concentric squares to concentric circles.
  constexpr float kQuarterPi = std::numbers::pi_v<float> / 4;
  const float x = 2 * u - 1, y = 2 * v - 1;
  float radius = 0, angle = 0;
  if (std::fabs(x) > std::fabs(y)) {
    radius = x;
    angle = kQuarterPi * (y / x);
  } else if (y != 0) {
    radius = y;
    angle = 2 * kQuarterPi - kQuarterPi * (x / y);
  }
  const float dx = radius * std::cos(angle), dy = radius * std::sin(angle);
  const float dz = std::sqrt(std::max(0.0f, 1 - dx * dx - dy * dy));

  // Two axes about the normal (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
  const float sign = std::copysign(1.0f, normal.z);
  const float a = -1 / (sign + normal.z), b = normal.x * normal.y * a;
  const Vec3 tangent{1 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x};
  const Vec3 bitangent{b, sign + normal.y * normal.y * a, -normal.y};
  return Normalize(dx * tangent + dy * bitangent + dz * normal);
}

Vec3 TrianglePoint(const Vec3& a, const Vec3& b, const Vec3& c, float u, float v) {
  const float root = std::sqrt(u);
  return (1 - root) * a + (root * (1 - v)) * b + (root * v) * c;
}

}  // namespace treelight::client
