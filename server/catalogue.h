#ifndef TREELIGHT_SERVER_CATALOGUE_H_
#define TREELIGHT_SERVER_CATALOGUE_H_

#include "absl/status/status.h"
#include "server/state.h"
#include "treelight/v1/photon_map.pb.h"

// The RPCs that look at the maps and the server without using the device; photon_map.proto says
// what each does.
namespace treelight::server {

absl::Status GetPhotonMap(State& state, const v1::GetPhotonMapRequest& request,
                          v1::PhotonMap& response);
absl::Status ListPhotonMaps(State& state, const v1::ListPhotonMapsRequest& request,
                            v1::ListPhotonMapsResponse& response);
absl::Status DeletePhotonMap(State& state, const v1::DeletePhotonMapRequest& request,
                             v1::DeletePhotonMapResponse& response);
absl::Status GetServerInfo(State& state, const v1::GetServerInfoRequest& request,
                           v1::ServerInfo& response);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_CATALOGUE_H_
