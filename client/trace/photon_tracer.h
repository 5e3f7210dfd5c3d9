#ifndef TREELIGHT_CLIENT_TRACE_PHOTON_TRACER_H_
#define TREELIGHT_CLIENT_TRACE_PHOTON_TRACER_H_

#include <array>
#include <cstdint>
#include <functional>

#include "absl/status/statusor.h"
#include "client/trace/intersector.h"
#include "core/model/photons.h"

namespace treelight::client {

/// Where the emitted power went, each [W] red, green, blue. But for rounding,
///   emitted = absorbed + escaped + roulette + cut.
struct EnergyBalance {
  using Power = std::array<double, 3>;
  Power emitted{};
  Power absorbed{};  ///< by surfaces: (1 - reflectance) of what arrives
  Power escaped{};   ///< left the scene
  Power roulette{};  ///< taken by Russian roulette less what it gave to the survivors; 0 in
                     ///< expectation
  Power cut{};       ///< on paths that were stopped at max_bounces
};

struct PhotonTraceOptions {
  std::uint64_t photon_count = 1'000'000;  ///< stored in both maps together, > 0
  std::uint64_t seed = 1;
  std::uint32_t max_bounces = 1024;  ///< scattering events of one path, > 0
  /// Called between rounds of work with the photons stored so far, on the calling thread.
  std::function<void(std::uint64_t photons)> progress{};
};

/// Photons on the diffuse surfaces of a scene. Light that comes straight from a light is in neither
/// set: it is left to shadow rays.
struct TracedPhotons {
  Photons indirect;  ///< reflected by a diffuse surface before: L (S|D)* D S* D
  Photons caustic;   ///< by mirrors and glass alone: L S+ D
  std::uint64_t emitted_paths = 0;
  std::uint64_t rays = 0;
  EnergyBalance energy;
};

/// Photon tracing (Jensen 2001, "Realistic Image Synthesis Using Photon Mapping", chapter 5).
///
/// Paths start on the lights in proportion to their power, about the normal with density cos / pi.
/// At a surface that reflects rho of the power P, the path goes on with probability p = max(rho P)
/// / max(P) and power rho P / p, so that the largest channel keeps its power all along the path.
/// Paths are traced in order of index until photon_count photons are stored; the path that reaches
/// it is kept whole, so a few more may come. The same scene, count and seed give the same photons
/// for any number of threads.
///
/// Runs on the TBB threads of the caller's arena. INVALID_ARGUMENT: photon_count or max_bounces is
/// 0. FAILED_PRECONDITION: the scene has no light, or its light does not reach diffuse surfaces.
absl::StatusOr<TracedPhotons> TracePhotons(const Intersector& intersector,
                                           const PhotonTraceOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_PHOTON_TRACER_H_
