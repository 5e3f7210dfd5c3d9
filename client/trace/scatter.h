#ifndef TREELIGHT_CLIENT_TRACE_SCATTER_H_
#define TREELIGHT_CLIENT_TRACE_SCATTER_H_

#include <optional>

#include "client/trace/dielectric.h"
#include "client/trace/intersector.h"

namespace treelight::client {

// How a path goes on from a hit. Radiance is carried divided by the squared index of its medium, so
// that refraction leaves it as it is (Veach 1997, section 5.2); lights and cameras stand in air.
//
// Surfaces scatter about Hit::shading_normal Ns, but what would leave them on the wrong side of
// Hit::normal Ng is absorbed: no light leaks through a facet. A path that comes from the camera
// gathers radiance with the weight f |wi.Ns|; for a path that comes from a light to carry the same
// light, the adjoint weight is
//   f |wi.Ns| |wo.Ng| / |wi.Ng|
// (Veach 1997, section 5.3, equation 5.19), wi towards the light and wo towards the camera. Where
// the normals agree both are the same. Panes know no shading normals.

/// Where a path began, and so what it carries.
enum class PathFrom {
  kCamera,  ///< importance: weights gather radiance
  kLight,   ///< photons: weights scale power
};

/// What happened to a path at a surface; the letters are those of path classes (Heckbert 1990).
enum class Event {
  kDiffuse,   ///< D
  kSpecular,  ///< S: mirror, glass, reflection by a pane, and the lobe of kGlossy
  kPassage,   ///< straight through a pane: no letter
};

/// Which events of a surface are meant.
enum class Lobes { kAll, kDiffuse, kSpecular };

/// A direction in which a path goes on, drawn at random.
struct Scattering {
  Vec3 direction;  ///< unit
  Rgb weight;  ///< what the event lets through, divided by the probability of direction and event
  float shading = 1;  ///< kLight: what shading normals add to the weight, as a factor; at most
                      ///< kMaxShading
  /// kCamera: what refraction adds to the weight, as a factor: (n_from / n_to)^2. It is not in the
  /// weight, by which paths live on: they should not end sooner inside glass.
  float radiance_scale = 1;
  Event event = Event::kDiffuse;
  /// With which `direction` is drawn, by whichever event, 1 / sr; 0: there is no other choice, as
  /// for mirror, glass and pane.
  float density = 0;
};

/// A value of the BSDF for a path from the camera.
struct ScatterValue {
  Rgb value;          ///< f |wi.Ns|, 1 / sr
  float density = 0;  ///< with which SampleScattering draws this direction, 1 / sr
};

/// The correction for shading normals at which a photon's power is cut: near the terminator
/// |wi.Ns| / |wi.Ng| has no bound. What is lost is of the order of 1 / kMaxShading of the light
/// that arrives within the angle between the two normals of grazing.
inline constexpr float kMaxShading = 16;

/// Draws by (u, v) in [0, 1)^2 how a path along `ray` goes on from `hit`, among `lobes`. Nothing:
/// it is absorbed, as everything is by a surface that has none of `lobes`. The mean of weight *
/// shading over draws is what the surface lets through.
std::optional<Scattering> SampleScattering(const Ray& ray, const Hit& hit, PathFrom from, float u,
                                           float v, Lobes lobes = Lobes::kAll);

/// What light from `direction` (unit, away from the surface) contributes to the radiance that
/// returns along `ray`, a path of the camera. 0 for mirror, glass and pane, which nothing but
/// SampleScattering can meet.
ScatterValue EvaluateScattering(const Ray& ray, const Hit& hit, const Vec3& direction,
                                Lobes lobes = Lobes::kAll);

/// Factor for the power of a photon that arrives along `ray`, so that the density of photons at
/// `hit` is the irradiance about the shading normal: |wi.Ns| / |wi.Ng|, at most kMaxShading; 0
/// where the light comes from behind the shading normal.
float ArrivalFactor(const Ray& ray, const Hit& hit);

/// Whether EvaluateScattering can give anything but 0 there: the surface is to be lit by sampled
/// lights.
bool ScattersWidely(const Material& material);

/// Balance heuristic (Veach 1997, section 9.2.2): the weight of a sample drawn with `density`, that
/// `other_density` could have drawn too. A density of 0 stands for no other choice: weight 1.
float BalanceWeight(float density, float other_density);

/// What the dielectric at `hit` does with the light, or the view, along `ray`, before absorption.
DielectricSplit SplitAtHit(const Ray& ray, const Hit& hit);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_SCATTER_H_
