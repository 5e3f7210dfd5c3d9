#include "client/trace/sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/scenes/vector.h"

namespace treelight::client {
namespace {

/// Two unit vectors that make a right-handed frame with the third.
struct Axes {
  Vec3 tangent, bitangent;
};

/// Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
Axes AxesAbout(const Vec3& normal) {
  const float sign = std::copysign(1.0f, normal.z);
  const float a = -1 / (sign + normal.z), b = normal.x * normal.y * a;
  return {{1 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x},
          {b, sign + normal.y * normal.y * a, -normal.y}};
}

Vec3 Around(const Vec3& axis, float sine, float cosine, float v) {
  const float angle = 2 * std::numbers::pi_v<float> * v;
  const auto [tangent, bitangent] = AxesAbout(axis);
  return Normalize((sine * std::cos(angle)) * tangent + (sine * std::sin(angle)) * bitangent +
                   cosine * axis);
}

}  // namespace

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
  const auto [tangent, bitangent] = AxesAbout(normal);
  return Normalize(dx * tangent + dy * bitangent + dz * normal);
}

Vec3 PhongDirection(const Vec3& axis, float exponent, float u, float v) {
  return DirectionAround(axis, std::pow(1 - u, 1 / (exponent + 1)), v);
}

Vec3 DirectionAround(const Vec3& axis, float cosine, float v) {
  return Around(axis, std::sqrt(std::max(0.0f, 1 - cosine * cosine)), cosine, v);
}

Vec3 ConeDirection(const Vec3& axis, float height, float u, float v) {
  // 1 - cos, not cos: the sine of a small angle would be lost.
  const float drop = height * u;
  return Around(axis, std::sqrt(std::max(0.0f, drop * (2 - drop))), 1 - drop, v);
}

Vec3 TrianglePoint(const Vec3& a, const Vec3& b, const Vec3& c, float u, float v) {
  const float root = std::sqrt(u);
  return (1 - root) * a + (root * (1 - v)) * b + (root * v) * c;
}

}  // namespace treelight::client
