#ifndef TREELIGHT_SERVER_SERVICE_H_
#define TREELIGHT_SERVER_SERVICE_H_

#include <string>

#include "server/state.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::server {

/// The RPCs of photon_map.proto, which says what each does. The methods run on gRPC's few threads
/// and do not block; those of one request read it once they are admitted (LateUnary).
class PhotonMapService final : public v1::PhotonMapService::CallbackService {
 public:
  /// `state` outlives the service.
  explicit PhotonMapService(State& state);

  grpc::ServerBidiReactor<v1::GatherRequest, v1::GatherResponse>* GatherStream(
      grpc::CallbackServerContext* context) override;

 private:
  template <typename Request, typename Response, typename Make>
  void HandleLate(const std::string& method, Make make);

  State& state_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_SERVICE_H_
