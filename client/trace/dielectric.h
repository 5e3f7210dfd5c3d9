#ifndef TREELIGHT_CLIENT_TRACE_DIELECTRIC_H_
#define TREELIGHT_CLIENT_TRACE_DIELECTRIC_H_

#include <optional>

#include "client/scenes/color.h"
#include "core/model/box.h"

namespace treelight::client {

/// `direction` reflected by a plane with unit normal `normal`.
Vec3 Reflect(const Vec3& direction, const Vec3& normal);

/// What a smooth boundary between two media does with unpolarised light.
struct DielectricSplit {
  float reflectance = 1;  ///< R, the share of the power that is reflected; 1 - R is refracted
  Vec3 reflected;         ///< unit
  std::optional<Vec3> refracted;  ///< unit; nothing under total internal reflection
  /// (n_from / n_to)^2: radiance on the side that the direction comes from, divided by that on the
  /// other, where the boundary lets all through. Power is not scaled (Veach 1996, "Non-symmetric
  /// Scattering in Light Transport Algorithms", section 4).
  float radiance_scale = 1;
};

/// Fresnel's equations and Snell's law.
/// `direction` is unit, towards the boundary; `normal` is unit, on the side that the light comes
/// from; `ior_ratio` is the index of the side it comes from divided by the index of the other side.
DielectricSplit SplitAtDielectric(const Vec3& direction, const Vec3& normal, float ior_ratio);

/// What a pane does with light: a sheet thinner than anything else, between whose faces it goes to
/// and fro. Shares of the power; what is missing to 1 is absorbed.
struct PaneSplit {
  Rgb reflected;  ///< into the mirror direction
  Rgb passed;     ///< straight on
};

/// All orders of reflection between the faces of a sheet, each with reflectance R by Fresnel's
/// equations, that lets the share t through on each way from one face to the other:
///   reflected = R + (1 - R)^2 R t^2 / (1 - R^2 t^2), which for t = 1 is 2 R / (1 + R)
///   passed = (1 - R)^2 t / (1 - R^2 t^2)
/// `cosine` of the angle of incidence is in [0, 1]; `ior` is the index of the sheet relative to
/// what is around it.
PaneSplit SplitAtPane(float cosine, float ior, const Rgb& transmittance);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_DIELECTRIC_H_
