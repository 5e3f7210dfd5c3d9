#ifndef TREELIGHT_CLIENT_SCENES_VECTOR_H_
#define TREELIGHT_CLIENT_SCENES_VECTOR_H_

#include <cmath>

#include "core/model/box.h"

namespace treelight::client {

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(const Vec3& v) { return {-v.x, -v.y, -v.z}; }
inline Vec3 operator*(float s, const Vec3& v) { return {s * v.x, s * v.y, s * v.z}; }

inline float Dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 Cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline float Length(const Vec3& v) { return std::sqrt(Dot(v, v)); }

/// `v` scaled to length 1; `v` must not be 0.
inline Vec3 Normalize(const Vec3& v) { return (1 / Length(v)) * v; }

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_VECTOR_H_
