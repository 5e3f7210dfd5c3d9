#ifndef TREELIGHT_CLIENT_REMOTE_MAP_H_
#define TREELIGHT_CLIENT_REMOTE_MAP_H_

#include "client/photon_map_client.h"
#include "core/gatherer.h"

namespace treelight::client {

/// A map of a server as a Gatherer, so that what works on maps works on those of a server too:
/// MeasureSearches of core/search_statistics.h.
class RemoteMap : public Gatherer {
 public:
  /// Of what the server says of the map. `client` must outlive it.
  RemoteMap(PhotonMapClient& client, const v1::PhotonMap& map);

  /// As PhotonMapClient::Gather, whose errors it has too. `cancelled` is asked before, not while
  /// the server works.
  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled = {}) const override;

  /// UNIMPLEMENTED: neither leaves the server.
  absl::StatusOr<Tree> ReadTree() const override;
  absl::StatusOr<Photons> ReadPhotons() const override;

  std::size_t photon_count() const override { return photon_count_; }
  bool has_powers() const override { return has_powers_; }
  bool has_directions() const override { return has_directions_; }
  const BuildReport& report() const override { return report_; }

 private:
  PhotonMapClient& client_;
  MapRef map_;
  std::size_t photon_count_;
  bool has_powers_, has_directions_;
  BuildReport report_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_REMOTE_MAP_H_
