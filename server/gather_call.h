#ifndef TREELIGHT_SERVER_GATHER_CALL_H_
#define TREELIGHT_SERVER_GATHER_CALL_H_

#include "grpcpp/support/server_callback.h"
#include "server/batch.h"
#include "server/call.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A Gather call: one batch, one message. Owns itself: made by the service, gone with OnDone.
class GatherCall final : public grpc::ServerUnaryReactor {
 public:
  /// gRPC keeps `request` and `response` until OnDone.
  GatherCall(State& state, grpc::CallbackServerContext& context, const v1::GatherRequest& request,
             v1::GatherResponse& response);

  void OnDone() override { delete this; }

 private:
  void Answer();
  void End(const absl::Status& status);

  State& state_;
  v1::GatherResponse& response_;
  Call call_;
  Batch batch_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_GATHER_CALL_H_
