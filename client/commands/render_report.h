#ifndef TREELIGHT_CLIENT_COMMANDS_RENDER_REPORT_H_
#define TREELIGHT_CLIENT_COMMANDS_RENDER_REPORT_H_

#include <optional>
#include <string>

#include "client/commands/render_options.h"
#include "client/render/image.h"
#include "client/render/map_upload.h"
#include "client/render/photon_renderer.h"
#include "client/trace/photon_tracer.h"

namespace treelight::client {

/// Whole time of each phase, seconds.
struct RenderTimes {
  double trace_s = 0, build_s = 0, render_s = 0, whole_s = 0;
};

/// What gathers did in the tree of each map; nothing where that is not known.
struct MapTraversals {
  std::optional<TraversalCost> indirect{}, caustic{};
};

/// What a render cost, as lines: a table with a column for each map (photons, stages of the build,
/// gathers and their largest radius), where the light went, and times.
std::string FormatRender(const TracedPhotons& photons, const UploadedMaps& maps,
                         const GatherRadii& radii, const PhotonRenderedImage& render,
                         const MapTraversals& traversals, const RenderTimes& times);

/// Where the light of a scene went, as one line.
std::string FormatEnergy(const TracedPhotons& photons);

/// How far a picture is from the reference, as one line.
std::string FormatError(const ImageError& error, const std::string& reference_path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_RENDER_REPORT_H_
