#ifndef TREELIGHT_SERVER_HEALTH_H_
#define TREELIGHT_SERVER_HEALTH_H_

#include <mutex>
#include <string_view>
#include <unordered_set>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/flood_guard.h"
#include "server/stall_watch.h"

namespace treelight::server {

/// gRPC's health checking (health.proto), of the server and of the photon map service, for whoever
/// connects: no token, no place among --max-calls. Instead of gRPC's own, which reads a request of
/// 4 MiB for each stream, and for ever. Here 16 requests may be on their way, for two seconds each;
/// where more are for a moment, StallWatch::kGrace, the oldest ends. That of a probe comes with its
/// call, and is never old.
class Health final : public grpc::health::v1::Health::CallbackService {
 public:
  /// SERVING. `stalls` ends the calls whose client takes no answer, `floods` counts them; both
  /// outlive the service.
  Health(StallWatch& stalls, FloodGuard& floods);

  /// NOT_SERVING from now on. Those who watch are told.
  void Close();

 private:
  class OneCall;
  class CheckCall;
  class WatchCall;
  using Response = grpc::health::v1::HealthCheckResponse;

  template <typename Handler>
  void Handle(int method);
  static bool IsKnown(std::string_view service);

  StallWatch& stalls_;
  FloodGuard& floods_;
  StallWatch requests_;  // calls whose request is on its way
  StallWatch watches_;   // calls that watch
  std::mutex mutex_;
  Response::ServingStatus status_ = Response::SERVING;  // guarded by mutex_
  std::unordered_set<WatchCall*> watching_;             // guarded by mutex_
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_HEALTH_H_
