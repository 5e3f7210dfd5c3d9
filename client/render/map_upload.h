#ifndef TREELIGHT_CLIENT_RENDER_MAP_UPLOAD_H_
#define TREELIGHT_CLIENT_RENDER_MAP_UPLOAD_H_

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "client/render/photon_renderer.h"
#include "client/trace/photon_tracer.h"

namespace treelight::client {

/// How UploadMaps names its maps, and how long they stay.
struct MapUploadOptions {
  std::string name = "render";               ///< the maps are NAME.indirect and NAME.caustic
  std::chrono::milliseconds time_to_live{};  ///< 0: the maps stay
  /// Called after every chunk with the photons of both maps sent so far, on the calling thread.
  std::function<void(std::uint64_t photons)> progress{};
};

/// Maps that were built from traced photons.
struct UploadedMaps {
  /// What the server says of each; nothing where there were no photons.
  std::optional<v1::BuildPhotonMapResponse> indirect, caustic;
  double seconds = 0;  ///< whole time, upload and build

  PhotonMaps refs() const;  ///< the exact versions
};

/// Uploads both sets of photons and builds their maps. The errors of
/// PhotonMapClient::BuildPhotonMap; a map that was already built is then deleted again.
absl::StatusOr<UploadedMaps> UploadMaps(PhotonMapClient& client, const TracedPhotons& photons,
                                        const MapUploadOptions& options);

/// Deletes the versions that UploadMaps built. Returns the first error.
absl::Status DeleteMaps(PhotonMapClient& client, const PhotonMaps& maps);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_MAP_UPLOAD_H_
