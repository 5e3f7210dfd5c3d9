#ifndef TREELIGHT_CLIENT_TRACE_LIGHTS_H_
#define TREELIGHT_CLIENT_TRACE_LIGHTS_H_

#include <cstdint>
#include <optional>
#include <vector>

#include "client/trace/intersector.h"

namespace treelight::client {

/// A point of a light, drawn at random.
struct LightPoint {
  Vec3 position;          ///< a triangle's is just off the surface, on its front
  float probability = 0;  ///< with which its light was drawn
  float density = 0;      ///< with which the point was drawn, 1 / unit^2; 0: a point light
  const PointLight* point = nullptr;  ///< of the scene; null: a triangle
  Vec3 normal = {};                   ///< a triangle's: unit, of the front
  Rgb emission = {};                  ///< a triangle's: radiance, W / unit^2 / sr
};

/// Density with which SampleDirection draws the unit direction `direction` from a point of a light,
/// 1 / sr: cos / pi about the normal of a triangle; of a point light, in proportion to intensity.
float DirectionDensity(const LightPoint& light, const Vec3& direction);

/// Maps (u, v) in [0, 1)^2 to a unit direction with that density.
Vec3 SampleDirection(const LightPoint& light, float u, float v);

/// Power per solid angle that leaves `light` in the unit direction `direction`, divided by the
/// density with which `light` was drawn: its mean over light points, integrated over all
/// directions, is the power of all lights, W / sr.
Rgb PowerTowards(const LightPoint& light, const Vec3& direction);

/// A photon that leaves a light.
struct Emission {
  Ray ray;
  Rgb power;  ///< divided by the density: its mean over draws is the power of all lights, W
};

/// Light of one light point that reaches a surface.
struct DirectLight {
  Vec3 direction;  ///< unit, from the surface towards the light
  /// On a plane at right angles to `direction`, divided by the density: the mean over draws of
  /// irradiance * cos is the irradiance of the surface, W / unit^2; of irradiance * (f cos) the
  /// radiance that it reflects, W / unit^2 / sr (EvaluateScattering).
  Rgb irradiance;
  float density = 0;  ///< with which the direction was drawn, 1 / sr; 0: of a point light, which
                      ///< scattering cannot meet
};

/// Direct light before it is known what stands in its way.
struct UnshadowedLight {
  DirectLight light;
  Segment
      shadow;  ///< from the surface to the light: what it lets pass of `light.irradiance` arrives
};

/// Intensity of `light` in the unit direction `direction`, W / sr. From falloff_begin to the rim of
/// the cone it falls as 3 s^2 - 2 s^3, s = (cos - cos_rim) / (cos_begin - cos_rim), cos of the
/// angle to the axis.
Rgb IntensityTowards(const PointLight& light, const Vec3& direction);

/// Power of `light`, the integral of its intensity: pi (2 - cos_begin - cos_rim) times that of the
/// axis, W.
Rgb PowerOf(const PointLight& light);

/// The lights of a scene: its triangles that emit and its point lights, drawn in proportion to
/// their power summed over the channels. Refers to the scene. A draw takes O(log lights).
class Lights {
 public:
  explicit Lights(const Scene& scene);

  bool empty() const { return lights_.empty(); }

  /// Whether rays can meet a light: some are triangles.
  bool can_be_met() const { return can_be_met_; }

  /// Power of all lights, W: the sum of pi * area * radiance, and of PowerOf.
  const Rgb& power() const { return power_; }

  /// Maps (u, v) in [0, 1)^2 to a point; points that are close in u and v stay close on a light.
  /// There must be a light.
  LightPoint Sample(double u, float v) const;

  /// Density with which SampleDirectLight draws `direction` (unit), in which a light that shines
  /// from `hit` was met after `distance`, 1 / sr.
  float Density(const Hit& hit, const Vec3& direction, float distance) const;

 private:
  struct Light {
    const PointLight* point = nullptr;  // null: a triangle
    Vec3 a, b, c, normal;
    Rgb emission;
    float area = 0;
    double first = 0, last = 0;  // its share of [0, 1)
  };
  std::vector<Light> lights_;
  Rgb power_;
  double weight_ = 0;  // summed channels of the power
  bool can_be_met_ = false;
};

/// Draws a light point by (u, v) in [0, 1)^2 and a direction from it by (s, t), as SampleDirection
/// does. The summed channels of `power` are always the same.
Emission SampleEmission(const Lights& lights, double u, float v, float s, float t);

/// Draws a light point by (u, v). Nothing: it is behind either normal of the surface at `hit` or
/// faces away.
std::optional<UnshadowedLight> SampleUnshadowedLight(const Lights& lights, const Hit& hit, float u,
                                                     float v);

/// Draws a light point by (u, v) and shoots a shadow ray at it from `hit`. Nothing: it is behind
/// either normal of the surface, faces away or is hidden. Whatever stands between hides, glass too:
/// its light is a caustic; but panes let their share pass.
std::optional<DirectLight> SampleDirectLight(const Intersector& intersector, const Lights& lights,
                                             const Hit& hit, float u, float v);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_LIGHTS_H_
