#ifndef TREELIGHT_CLIENT_TRACE_LIGHTS_H_
#define TREELIGHT_CLIENT_TRACE_LIGHTS_H_

#include <cstdint>
#include <optional>
#include <vector>

#include "client/trace/intersector.h"

namespace treelight::client {

/// A point of a light, drawn at random.
struct LightPoint {
  Vec3 position;      ///< just off the surface, on its front
  Vec3 normal;        ///< unit, of the front
  Rgb emission;       ///< radiance, W / unit^2 / sr
  float density = 0;  ///< with which the point was drawn, 1 / unit^2
};

/// Light of one light point that reaches a surface.
struct DirectLight {
  Rgb irradiance;     ///< divided by the density: its mean over draws is the irradiance, W / unit^2
  float density = 0;  ///< with which this direction was drawn, 1 / sr
  float scatter_density = 0;  ///< with which a diffuse surface scatters into it: cos / pi, 1 / sr
};

/// The triangles of a scene that emit, drawn in proportion to their power summed over the channels.
class Lights {
 public:
  explicit Lights(const Scene& scene);

  bool empty() const { return triangles_.empty(); }

  /// Power of all lights: the sum of pi * area * radiance, W.
  const Rgb& power() const { return power_; }

  /// Maps (u, v) in [0, 1)^2 to a point; points that are close in u and v stay close on a light.
  /// There must be a light.
  LightPoint Sample(float u, float v) const;

  /// Density with which Sample draws a point of a triangle of `material`, 1 / unit^2.
  float Density(const Material& material) const;

 private:
  struct Triangle {
    Vec3 a, b, c, normal;
    Rgb emission;
    double first = 0, last = 0;  // its share of [0, 1)
  };
  std::vector<Triangle> triangles_;
  Rgb power_;
  double weight_ = 0;  // sum over the triangles of area * summed channels of the radiance
};

/// Draws a light point by (u, v) and shoots a shadow ray at it from `hit`. Nothing: it is behind
/// the surface, faces away or is hidden. Whatever stands between hides, glass too: its light is a
/// caustic.
std::optional<DirectLight> SampleDirectLight(const Intersector& intersector, const Lights& lights,
                                             const Hit& hit, float u, float v);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_LIGHTS_H_
