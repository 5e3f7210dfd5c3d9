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

/// Renders a few pixels, about 4096, from two small sets of photons, with two sets of camera rays:
/// what changes with the photons alone is their noise, what changes with the rays alone that of the
/// camera, and the product of both differences what pixels have of photons whatever their rays. At
/// two radii it also looks at a quarter of the area (RadiusProbe), which tells how the blur goes
/// with the radius.
///
/// Of `options` it takes picture, kernels, ratio of both sets, seed and map name; its random
/// numbers are not those of any pass. Its maps are deleted. The same findings, times apart, for any
/// number of threads. Blocks. The errors of RenderProgressively.
absl::StatusOr<PilotReport> RunPilot(const Intersector& intersector, PhotonMapClient& client,
                                     const ProgressiveOptions& options);

/// `options` with the photons, k, samples and passes of `plan`; both estimates and sets of photons
/// keep their ratio.
ProgressiveOptions Planned(const ProgressiveOptions& options, const PassPlan& plan);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PILOT_H_
