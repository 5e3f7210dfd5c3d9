#ifndef TREELIGHT_CLIENT_TRACE_SAMPLING_H_
#define TREELIGHT_CLIENT_TRACE_SAMPLING_H_

#include "core/model/box.h"

namespace treelight::client {

/// Maps (u, v) in [0, 1)^2 to a unit direction about the unit vector `normal` with density cos / pi
/// (Malley's method, after Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square").
Vec3 CosineDirection(const Vec3& normal, float u, float v);

/// Maps (u, v) in [0, 1)^2 to a unit direction about the unit vector `axis` with density
/// (n + 1) / (2 pi) cos^n of the angle to it, n = `exponent` >= 0, within the hemisphere (Lafortune
/// and Willems 1994, "Using the Modified Phong Reflectance Model", section 3).
Vec3 PhongDirection(const Vec3& axis, float exponent, float u, float v);

/// The unit direction at an angle of `cosine` to the unit vector `axis` and of 2 pi v around it.
Vec3 DirectionAround(const Vec3& axis, float cosine, float v);

/// Maps (u, v) in [0, 1)^2 to a unit direction, uniform by solid angle within the cone about the
/// unit vector `axis` whose half angle has the cosine 1 - `height`; `height` is in (0, 2], however
/// small.
Vec3 ConeDirection(const Vec3& axis, float height, float u, float v);

/// Maps (u, v) in [0, 1)^2 to a point of the triangle a, b, c, uniform by area (Turk 1990).
Vec3 TrianglePoint(const Vec3& a, const Vec3& b, const Vec3& c, float u, float v);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_SAMPLING_H_
