#ifndef TREELIGHT_SERVER_REBUILD_CALL_H_
#define TREELIGHT_SERVER_REBUILD_CALL_H_

#include "server/build_job.h"
#include "server/late_unary.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A RebuildPhotonMap call: has the photons of a map, read back from its device, built anew.
class RebuildCall final
    : public LateUnary<v1::RebuildPhotonMapRequest, v1::BuildPhotonMapResponse> {
 public:
  RebuildCall(State& state, grpc::CallbackServerContext& context);

 private:
  Call& call() override { return job_.call(); }
  void Run(const absl::Status& status) override;
  void Begin();
  absl::StatusOr<MapHandle> Prepare();
  void Ended(const absl::Status& status) { End(job_.End(status)); }

  State& state_;
  BuildJob job_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_REBUILD_CALL_H_
