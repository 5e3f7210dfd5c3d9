#ifndef TREELIGHT_CLIENT_BENCH_REMOTE_BUILDER_H_
#define TREELIGHT_CLIENT_BENCH_REMOTE_BUILDER_H_

#include <string>

#include "client/photon_map_client.h"
#include "core/builder.h"

namespace treelight::client {

/// Maps of a server as a Builder makes them: what measures builders measures those of a server too.
class RemoteBuilder : public Builder {
 public:
  /// `client` must outlive it, and the maps.
  explicit RemoteBuilder(PhotonMapClient& client);

  /// Uploads and builds; the map is deleted on the server when it goes here, or after an hour. The
  /// errors of PhotonMapClient::BuildPhotonMap. `cancelled` is asked before, not while the server
  /// works.
  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled = {}) override;

 private:
  PhotonMapClient& client_;
  const std::string name_;  // of all maps, each a version
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BENCH_REMOTE_BUILDER_H_
