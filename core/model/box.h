#ifndef TREELIGHT_CORE_MODEL_BOX_H_
#define TREELIGHT_CORE_MODEL_BOX_H_

#include <algorithm>
#include <limits>

namespace treelight {

/// Point or vector, scene units.
struct Vec3 {
  float x = 0, y = 0, z = 0;
  friend bool operator==(const Vec3&, const Vec3&) = default;
};

/// Component `axis` (0, 1, 2) of `v`.
inline float Component(const Vec3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// Squared distance as every part of Treelight computes it: float32, rounded after each operation,
/// never contracted to a fused multiply-add, (dx*dx + dy*dy) + dz*dz. Scene units squared.
inline float SquaredDistance(const Vec3& a, const Vec3& b) {
  const float dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
  return (dx * dx + dy * dy) + dz * dz;
}

/// Axis-aligned box, scene units. The default is empty: `min` is +inf and `max` is -inf.
struct Box {
  Vec3 min{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
           std::numeric_limits<float>::infinity()};
  Vec3 max{-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
           -std::numeric_limits<float>::infinity()};

  void Extend(const Vec3& p) {
    min = {std::min(min.x, p.x), std::min(min.y, p.y), std::min(min.z, p.z)};
    max = {std::max(max.x, p.x), std::max(max.y, p.y), std::max(max.z, p.z)};
  }
  void Extend(const Box& b) {
    Extend(b.min);
    Extend(b.max);
  }
  friend bool operator==(const Box&, const Box&) = default;
};

/// The box between two corners [3], as nodes and roots of trees hold it.
inline Box MakeBox(const float* min, const float* max) {
  return {{min[0], min[1], min[2]}, {max[0], max[1], max[2]}};
}

/// SquaredDistance from `q` to the nearest point of a box: never above that to any point inside.
inline float BoxSquaredDistance(const Vec3& q, const Box& box) {
  const float dx = std::max(std::max(box.min.x - q.x, q.x - box.max.x), 0.0f);
  const float dy = std::max(std::max(box.min.y - q.y, q.y - box.max.y), 0.0f);
  const float dz = std::max(std::max(box.min.z - q.z, q.z - box.max.z), 0.0f);
  return (dx * dx + dy * dy) + dz * dz;
}

/// Whether an axis-aligned plane separates two boxes that are not empty; they may touch it.
inline bool Separable(const Box& a, const Box& b) {
  for (int axis = 0; axis < 3; ++axis) {
    if (Component(a.max, axis) <= Component(b.min, axis) ||
        Component(b.max, axis) <= Component(a.min, axis)) {
      return true;
    }
  }
  return false;
}

/// Surface area of a box that is not empty, scene units squared, in double against overflow.
inline double SurfaceArea(const Box& box) {
  const double dx = double{box.max.x} - box.min.x, dy = double{box.max.y} - box.min.y,
               dz = double{box.max.z} - box.min.z;
  return 2 * (dx * dy + dy * dz + dz * dx);
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_BOX_H_
