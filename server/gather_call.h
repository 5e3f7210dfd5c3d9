#ifndef TREELIGHT_SERVER_GATHER_CALL_H_
#define TREELIGHT_SERVER_GATHER_CALL_H_

#include "server/batch.h"
#include "server/late_unary.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A Gather call: one batch, one message.
class GatherCall final : public LateUnary<v1::GatherRequest, v1::GatherResponse> {
 public:
  GatherCall(State& state, grpc::CallbackServerContext& context);

 private:
  Call& call() override { return call_; }
  void Run(const absl::Status& status) override;
  void Answer();
  void Ended(const absl::Status& status);

  State& state_;
  Call call_;
  Batch batch_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_GATHER_CALL_H_
