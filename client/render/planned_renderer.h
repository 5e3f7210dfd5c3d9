#ifndef TREELIGHT_CLIENT_RENDER_PLANNED_RENDERER_H_
#define TREELIGHT_CLIENT_RENDER_PLANNED_RENDERER_H_

#include <functional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "client/render/pass_plan.h"
#include "client/render/pilot.h"
#include "client/render/progressive_renderer.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// Renders in passes that a pilot plans for options.target_error, > 0. Where they show much more
/// blur than it did, so that it would be most of the error, they are dropped, and more photons are
/// planned by what they found: no number of passes of one radius takes blur away. Radii shrink once
/// no plan is left that reaches the error.
///
/// options.time_limit_s is that of all passes together.
/// @param planned  called with each plan and with what all pilots took, before its passes; an error
///                 ends the run
/// The errors of PlanByPilots and RenderProgressively.
absl::StatusOr<ProgressiveResult> RenderPlanned(
    const Intersector& intersector, PhotonMapClient& client, const ProgressiveOptions& options,
    const PlanLimits& limits, const std::function<absl::Status(const PilotPlan&)>& planned);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PLANNED_RENDERER_H_
