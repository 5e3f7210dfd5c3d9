#ifndef TREELIGHT_CLIENT_RENDER_PILOT_H_
#define TREELIGHT_CLIENT_RENDER_PILOT_H_

#include <cstdint>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "client/render/pass_plan.h"
#include "client/render/progressive_renderer.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// What RunPilot took.
struct PilotReport {
  PilotFindings findings;
  std::uint64_t photons = 0;  ///< traced, all sets
  double seconds = 0;
};

/// How much a pilot looks at.
struct PilotSize {
  std::uint64_t photons = 20'000;  ///< of each of two sets
  std::uint32_t k = 96;
  std::uint64_t pixels = 4096;  ///< about
};
inline constexpr PilotSize kSmallPilot{.photons = 5'000};

/// Renders a few pixels from two small sets of photons, with two sets of camera rays: what changes
/// with the photons alone is their noise, what changes with the rays alone that of the camera, and
/// the product of both differences what pixels have of photons whatever their rays. Further rays in
/// the same quarters of pixels as the first tell how much of the camera's noise comes from where in
/// the pixel they lie. A quarter of the area (RadiusProbe) tells of the blur.
///
/// Of `options` it takes picture, kernels, ratio of both sets, seed and map name; its random
/// numbers are not those of any pass. Its maps are deleted. The same findings, times apart, for any
/// number of threads. Blocks. The errors of RenderProgressively.
absl::StatusOr<PilotReport> RunPilot(const Intersector& intersector, PhotonMapClient& client,
                                     const ProgressiveOptions& options, const PilotSize& size);

/// What is to be rendered, and what the pilots that planned it took and found.
struct PilotPlan {
  PassPlan plan;
  PilotReport pilot;  ///< photons and seconds of all, findings of the last
};

/// Plans passes for options.target_error, > 0, by a small pilot; where the plan takes so long that
/// a larger one is a small part of it, by that. The errors of RunPilot.
absl::StatusOr<PilotPlan> PlanByPilots(const Intersector& intersector, PhotonMapClient& client,
                                       const ProgressiveOptions& options, const PlanLimits& limits);

/// `options` with the photons, k, samples and passes of `plan`; both estimates and sets of photons
/// keep their ratio.
ProgressiveOptions Planned(const ProgressiveOptions& options, const PassPlan& plan);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PILOT_H_
