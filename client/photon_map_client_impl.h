#ifndef TREELIGHT_CLIENT_PHOTON_MAP_CLIENT_IMPL_H_
#define TREELIGHT_CLIENT_PHOTON_MAP_CLIENT_IMPL_H_

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "client/map_metadata.h"
#include "client/photon_map_client.h"
#include "client/retry.h"
#include "client/status.h"
#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::client {

/// End of a call; time_point::max() means never.
using Deadline = std::chrono::system_clock::time_point;

/// The map that a request names, by which balancers choose its server: of a rebuild the one that is
/// built. Empty where it names none.
template <typename Request>
const std::string& MapOf(const Request& request) {
  static const std::string none;
  if constexpr (requires { request.new_name(); }) {
    if (!request.new_name().empty()) return request.new_name();
  }
  if constexpr (requires { request.name(); }) return request.name();
  return none;
}

/// What the files that implement PhotonMapClient and GatherPipeline share.
struct PhotonMapClient::Impl {
  Impl(std::shared_ptr<grpc::Channel> channel, std::chrono::milliseconds call_timeout)
      : stub(v1::PhotonMapService::NewStub(channel)), timeout(call_timeout) {}

  /// When a call that begins now must end.
  Deadline NextDeadline() const {
    return timeout.count() == 0 ? Deadline::max() : std::chrono::system_clock::now() + timeout;
  }

  /// Makes a unary call, `method` being a member of Stub.
  template <typename Request, typename Response>
  absl::StatusOr<Response> Call(grpc::Status (v1::PhotonMapService::Stub::*method)(
                                    grpc::ClientContext*, const Request&, Response*),
                                const Request& request, Deadline deadline) {
    grpc::ClientContext context;
    context.set_deadline(deadline);
    NameMap(context, MapOf(request));
    Response response;
    const grpc::Status status = (stub.get()->*method)(&context, request, &response);
    if (!status.ok()) return ToAbslStatus(status);
    return response;
  }

  /// Makes `attempt` until it is neither a refusal nor a break that is worth a repeat. For calls
  /// that may be made twice: those that change nothing, or have a request id.
  template <typename Attempt>
  auto Repeat(Deadline deadline, Attempt attempt) {
    RetryPolicy policy(deadline, retry_patience);
    while (true) {
      auto result = attempt();
      if (result.ok()) return result;
      ForgetLimits();
      const auto pause = policy.NextPause(result.status());
      if (!pause) return result;
      std::this_thread::sleep_for(*pause);
    }
  }

  /// GetPhotonMap, asked once.
  absl::StatusOr<v1::PhotonMap> Describe(const MapRef& map, Deadline deadline);

  /// The server's limits, asked for once; a limit that the server does not tell has its documented
  /// value.
  absl::StatusOr<v1::ServerLimits> GetLimits(Deadline deadline);

  /// Asks for the limits again before the next use: after an error, for the server may be another
  /// one now.
  void ForgetLimits();

  const std::unique_ptr<v1::PhotonMapService::Stub> stub;
  const std::chrono::milliseconds timeout;  // zero: none
  std::chrono::milliseconds retry_patience = std::chrono::seconds(30);

 private:
  std::mutex mutex_;
  std::optional<v1::ServerLimits> limits_;  // guarded by mutex_
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_PHOTON_MAP_CLIENT_IMPL_H_
