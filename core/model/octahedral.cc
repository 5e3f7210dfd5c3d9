#include "core/model/octahedral.h"

#include <algorithm>
#include <cmath>

namespace treelight {
namespace {

float SignNotZero(float v) { return v >= 0 ? 1.0f : -1.0f; }

}  // namespace

std::array<std::int16_t, 2> EncodeOctahedral(const Vec3& unit) {
  const float norm = std::fabs(unit.x) + std::fabs(unit.y) + std::fabs(unit.z);
  float u = unit.x / norm, v = unit.y / norm;
  if (unit.z < 0) {
    const float folded = (1 - std::fabs(v)) * SignNotZero(u);
    v = (1 - std::fabs(u)) * SignNotZero(v);
    u = folded;
  }
  const auto quantise = [](float value) {
    return static_cast<std::int16_t>(std::lround(std::clamp(value, -1.0f, 1.0f) * 32767));
  };
  return {quantise(u), quantise(v)};
}

Vec3 DecodeOctahedral(std::int16_t u, std::int16_t v) {
  constexpr float kStep = 1.0f / 32767;
  float x = static_cast<float>(std::max<int>(u, -32767)) * kStep;
  float y = static_cast<float>(std::max<int>(v, -32767)) * kStep;
  const float z = 1 - std::fabs(x) - std::fabs(y);
  if (z < 0) {
    const float folded = (1 - std::fabs(y)) * SignNotZero(x);
    y = (1 - std::fabs(x)) * SignNotZero(y);
    x = folded;
  }
  return {x, y, z};
}

bool ComesAgainst(const std::int16_t* direction, const float* normal) {
  const Vec3 d = DecodeOctahedral(direction[0], direction[1]);
  return d.x * normal[0] + d.y * normal[1] + d.z * normal[2] < 0;
}

}  // namespace treelight
