#ifndef TREELIGHT_CLIENT_TRACE_SAMPLING_H_
#define TREELIGHT_CLIENT_TRACE_SAMPLING_H_

#include "core/model/box.h"

namespace treelight::client {

/// Maps (u, v) in [0, 1)^2 to a unit direction about the unit vector `normal` with density cos / pi
/// (Malley's method, after Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square").
Vec3 CosineDirection(const Vec3& normal, float u, float v);

/// Maps (u, v) in [0, 1)^2 to a point of the triangle a, b, c, uniform by area (Turk 1990).
Vec3 TrianglePoint(const Vec3& a, const Vec3& b, const Vec3& c, float u, float v);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_SAMPLING_H_
