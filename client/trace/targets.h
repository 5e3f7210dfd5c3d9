#ifndef TREELIGHT_CLIENT_TRACE_TARGETS_H_
#define TREELIGHT_CLIENT_TRACE_TARGETS_H_

#include <cstddef>
#include <vector>

#include "client/scenes/scene.h"
#include "client/trace/lights.h"
#include "client/trace/random.h"

namespace treelight::client {

/// Whether light that `material` reflects or refracts is focussed, so that what it lights needs a
/// map of its own: mirror, glass and the lobe of kGlossy. A pane is flat: what passes goes straight
/// on and is direct light, and what it reflects is as smooth as indirect light.
bool MakesCaustics(const Material& material);

/// Spheres that together hold every specular surface of a scene, so that photons of the caustic map
/// can be aimed. Panes are among them: by way of their reflection light meets glass. None where
/// nothing makes caustics.
///
/// The tree of the shapes, split in the middle along the widest axis into at most kMaxTargets
/// groups; groups are joined again where the spheres of the parts are hardly smaller than that of
/// the whole.
class Targets {
 public:
  static constexpr std::size_t kMaxTargets = 32;

  struct Bound {
    Vec3 center;
    float radius;  ///< > 0
  };

  explicit Targets(const Scene& scene);

  bool empty() const { return bounds_.empty(); }
  const std::vector<Bound>& bounds() const { return bounds_; }

 private:
  std::vector<Bound> bounds_;
};

/// Draws a photon that leaves a light towards `targets`, of which there must be one.
///
/// The light point x is drawn as by SampleEmission; the direction from a mixture of densities
///   p = d p0 + (1 - d) sum_i w_i(x) q_i,   d = kDefensiveShare
/// p0 as SampleDirection, q_i uniform in the cone that just holds bound i, or p0 where x is inside
/// of it; w_i in proportion to how much of the power from x may go into that cone. The power is
/// that towards the direction divided by p, so it is unbiased whatever the bounds (Veach and Guibas
/// 1995, "Optimally Combining Sampling Techniques", the one-sample balance heuristic). It may be 0:
/// where the cone reaches below the horizon of the light.
Emission SampleEmissionTowards(const Targets& targets, const Lights& lights, RandomStream& random);

/// Share of targeted photons that leave the light in all its directions, so that none has density
/// 0.
inline constexpr float kDefensiveShare = 0.05f;

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_TARGETS_H_
