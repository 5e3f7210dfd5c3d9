#ifndef TREELIGHT_CLIENT_RENDER_PASS_MAPS_H_
#define TREELIGHT_CLIENT_RENDER_PASS_MAPS_H_

#include <cstdint>
#include <optional>

#include "absl/status/statusor.h"
#include "client/render/map_upload.h"
#include "client/render/photon_renderer.h"
#include "client/trace/intersector.h"
#include "client/trace/photon_tracer.h"

namespace treelight::client {

/// The radius of the first pass of one map. Where none is given, that within which `quantile` of
/// the photons of the first pass have their k nearest (RadiusOfNearest).
struct FirstRadius {
  std::optional<float> given{};  ///< scene units
  std::uint32_t k = 0;           ///< > 0; also where the estimate has no k
  double quantile = 1;
};

/// The photons of one pass, and what becomes of them.
struct PassMapOptions {
  std::uint64_t indirect_photons = 0, caustic_photons = 0;
  std::uint64_t seed = 1;
  MapUploadOptions upload{};
  FirstRadius indirect{}, caustic{};
  CancelCheck cancelled{};                   ///< while photons are traced
  const PhotonEmitters* emitters = nullptr;  ///< as PhotonTraceOptions
};

/// The maps of one pass.
struct PassMaps {
  PhotonMaps maps;
  std::uint64_t photons = 0;                             ///< of both maps
  std::optional<float> indirect_radius, caustic_radius;  ///< nothing: there is no such map
  double seconds = 0;                                    ///< traced, sent, built and measured
};

/// Traces the photons of a pass, builds maps of them on the server and chooses their radii. Blocks.
/// The errors of TracePhotons and PhotonMapClient; no map is left then.
absl::StatusOr<PassMaps> MakePassMaps(const Intersector& intersector, PhotonMapClient& client,
                                      const PassMapOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PASS_MAPS_H_
