#ifndef TREELIGHT_CLIENT_TRACE_DIELECTRIC_H_
#define TREELIGHT_CLIENT_TRACE_DIELECTRIC_H_

#include <optional>

#include "core/model/box.h"

namespace treelight::client {

/// `direction` reflected by a plane with unit normal `normal`.
Vec3 Reflect(const Vec3& direction, const Vec3& normal);

/// What a smooth boundary between two media does with unpolarised light.
struct DielectricSplit {
  float reflectance = 1;  ///< R, the share of the power that is reflected; 1 - R is refracted
  Vec3 reflected;         ///< unit
  std::optional<Vec3> refracted;  ///< unit; nothing under total internal reflection
};

/// Fresnel's equations and Snell's law.
/// `direction` is unit, towards the boundary; `normal` is unit, on the side that the light comes
/// from; `ior_ratio` is the index of the side it comes from divided by the index of the other side.
DielectricSplit SplitAtDielectric(const Vec3& direction, const Vec3& normal, float ior_ratio);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_DIELECTRIC_H_
