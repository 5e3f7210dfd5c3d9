#ifndef TREELIGHT_SERVER_REBUILD_CALL_H_
#define TREELIGHT_SERVER_REBUILD_CALL_H_

#include "grpcpp/support/server_callback.h"
#include "server/build_job.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A RebuildPhotonMap call: has the photons of a map, read back from its device, built anew. Owns
/// itself: made by the service, gone with OnDone.
class RebuildCall final : public grpc::ServerUnaryReactor {
 public:
  RebuildCall(State& state, grpc::CallbackServerContext& context,
              const v1::RebuildPhotonMapRequest& request, v1::BuildPhotonMapResponse& response);

  void OnDone() override { delete this; }

 private:
  void Begin(const v1::RebuildPhotonMapRequest& request);
  absl::StatusOr<MapHandle> Prepare(const v1::RebuildPhotonMapRequest& request);
  void End(const absl::Status& status) { Finish(job_.End(status)); }

  State& state_;
  BuildJob job_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_REBUILD_CALL_H_
