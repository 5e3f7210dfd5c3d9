#ifndef TREELIGHT_CLIENT_TRACE_PHOTON_TRACER_H_
#define TREELIGHT_CLIENT_TRACE_PHOTON_TRACER_H_

#include <array>
#include <cstdint>
#include <functional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/trace/intersector.h"
#include "client/trace/lights.h"
#include "client/trace/targets.h"
#include "core/model/photons.h"

namespace treelight::client {

/// Power, W: red, green, blue.
using Power = std::array<double, 3>;

/// Where the power that the paths of the indirect set carried went. But for rounding,
///   emitted = absorbed_diffuse + absorbed_elsewhere + escaped + shading + roulette + cut.
/// Every path is followed to its end for it, caustics included.
struct EnergyBalance {
  Power emitted{};
  Power absorbed_diffuse{};    ///< by kDiffuse and kGlossy surfaces, where photons are stored
  Power absorbed_elsewhere{};  ///< by mirrors, glass and panes
  Power escaped{};             ///< left the scene
  Power shading{};   ///< taken by shading normals less what they gave; 0 where a scene has none
  Power roulette{};  ///< taken by Russian roulette less what it gave to the survivors; 0 in
                     ///< expectation
  Power cut{};       ///< on paths that were stopped at max_bounces

  // What arrived at diffuse surfaces, each time that it did.
  Power direct{};    ///< straight from a light or through panes; not stored
  Power indirect{};  ///< that is stored in the indirect set
  Power caustic{};   ///< that belongs to the caustic set, by untargeted paths
};

/// The two sets of photons that are stored. A path's letters are L for the light, D for a diffuse
/// event and S for a specular one, the lobe of kGlossy included; straight passage of a pane has no
/// letter, and reflection by a pane counts as S only after what MakesCaustics().
enum class PhotonSet {
  kIndirect,  ///< L (S|D)* D S* D, and L D by way of the reflection of panes
  kCaustic,   ///< L S+ D
};

/// How the paths of the caustic set leave the lights.
enum class CausticEmission {
  kTargeted,  ///< towards specular surfaces (SampleEmissionTowards)
  kUniform,   ///< as those of the indirect set
};

/// Where the photons of a scene come from and go to, found once for many sets: that of a scene of
/// 10^6 triangles takes longer than a small set. Immutable; the scene may go.
struct PhotonEmitters {
  explicit PhotonEmitters(const Scene& scene) : lights(scene), targets(scene) {}

  Lights lights;
  Targets targets;
};

struct PhotonTraceOptions {
  std::uint64_t indirect_photons = 1'000'000;  ///< stored; 0: the set is left out
  std::uint64_t caustic_photons = 200'000;  ///< stored where something makes caustics; 0: left out
  std::uint64_t seed = 1;
  std::uint32_t max_bounces = 1024;  ///< scattering events of one path, > 0
  CausticEmission caustic_emission = CausticEmission::kTargeted;
  /// Called between rounds of work with the photons of both sets stored so far, on the calling
  /// thread.
  std::function<void(std::uint64_t photons)> progress{};
  /// Asked as often, on the calling thread; true ends tracing.
  std::function<bool()> cancelled{};
  /// Of the scene, borrowed; null: they are found anew.
  const PhotonEmitters* emitters = nullptr;
};

/// What one set of photons took.
struct PhotonSetReport {
  std::uint64_t photons = 0;
  std::uint64_t paths = 0;
  std::uint64_t rays = 0;
  Power stored{};       ///< sum of the photons' power, W
  float max_power = 0;  ///< the largest channel of a photon, W
};

/// What tracing took, and where the light went.
struct TraceReport {
  PhotonSetReport indirect, caustic;
  EnergyBalance energy;  ///< zeros where there is no indirect set
};

/// Gets the photons of a set in order, in blocks, on the calling thread. Powers are those of one
/// path: what it carries when the light has one path only, to be divided by the paths of the set,
/// which are known at the end. An error ends tracing.
using PhotonSink = std::function<absl::Status(PhotonSet set, const Photons& block)>;

/// Photon tracing (Jensen 2001, "Realistic Image Synthesis Using Photon Mapping", chapter 5), the
/// indirect set first. Takes some tens of MiB, however many photons there are.
///
/// Paths start on the lights in proportion to their power. At a surface that lets the share rho of
/// the power P go on, the path goes on with probability p = max(rho P) / max(P), at most 1, and
/// power rho P / p: without shading normals the largest channel keeps its power all along. Paths of
/// the caustic set end at their first diffuse event. Light that comes straight from a light is in
/// neither set: it is left to shadow rays.
///
/// Photons are stored at kDiffuse and kGlossy surfaces, where their density times reflectance / pi
/// is the radiance of the Lambertian part; their power holds ArrivalFactor(). Paths are traced in
/// order of index until enough photons are stored; the path that reaches the count is kept whole,
/// so a few more may come. The same scene, options and seed give the same photons for any number of
/// threads, and a set does not depend on the size of the other.
///
/// A set of which less than 1 path in 10^4 stores a photon, over 10^6 paths, is given up: it has
/// fewer photons then, whose power is right all the same.
///
/// Runs on the TBB threads of the caller's arena. INVALID_ARGUMENT: both counts are 0, or
/// max_bounces is. FAILED_PRECONDITION: the scene has no light, or no photon was stored.
/// CANCELLED: options.cancelled said so. Else the error of `sink`.
absl::StatusOr<TraceReport> TracePhotons(const Intersector& intersector,
                                         const PhotonTraceOptions& options, const PhotonSink& sink);

/// Both sets in memory, with powers in W.
struct TracedPhotons {
  Photons indirect, caustic;
  TraceReport report;
};
absl::StatusOr<TracedPhotons> TracePhotons(const Intersector& intersector,
                                           const PhotonTraceOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_PHOTON_TRACER_H_
