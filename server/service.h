#ifndef TREELIGHT_SERVER_SERVICE_H_
#define TREELIGHT_SERVER_SERVICE_H_

#include "server/state.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::server {

/// The RPCs of photon_map.proto, which says what each does. The methods run on gRPC's few threads
/// and do not block.
class PhotonMapService final : public v1::PhotonMapService::CallbackService {
 public:
  /// `state` outlives the service.
  explicit PhotonMapService(State& state) : state_(state) {}

  grpc::ServerReadReactor<v1::BuildPhotonMapRequest>* BuildPhotonMap(
      grpc::CallbackServerContext* context, v1::BuildPhotonMapResponse* response) override;
  grpc::ServerUnaryReactor* RebuildPhotonMap(grpc::CallbackServerContext* context,
                                             const v1::RebuildPhotonMapRequest* request,
                                             v1::BuildPhotonMapResponse* response) override;
  grpc::ServerUnaryReactor* Gather(grpc::CallbackServerContext* context,
                                   const v1::GatherRequest* request,
                                   v1::GatherResponse* response) override;
  grpc::ServerBidiReactor<v1::GatherRequest, v1::GatherResponse>* GatherStream(
      grpc::CallbackServerContext* context) override;
  grpc::ServerUnaryReactor* GetPhotonMap(grpc::CallbackServerContext* context,
                                         const v1::GetPhotonMapRequest* request,
                                         v1::PhotonMap* response) override;
  grpc::ServerUnaryReactor* ListPhotonMaps(grpc::CallbackServerContext* context,
                                           const v1::ListPhotonMapsRequest* request,
                                           v1::ListPhotonMapsResponse* response) override;
  grpc::ServerUnaryReactor* DeletePhotonMap(grpc::CallbackServerContext* context,
                                            const v1::DeletePhotonMapRequest* request,
                                            v1::DeletePhotonMapResponse* response) override;
  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context,
                                          const v1::GetServerInfoRequest* request,
                                          v1::ServerInfo* response) override;

 private:
  State& state_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_SERVICE_H_
