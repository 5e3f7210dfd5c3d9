#ifndef TREELIGHT_SERVER_CALL_H_
#define TREELIGHT_SERVER_CALL_H_

#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "core/gatherer.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/status.h"
#include "server/state.h"

namespace treelight::server {

/// The same code and message, with google.rpc.Status where there are payloads; the codes have the
/// same numbers.
grpc::Status ToGrpcStatus(const absl::Status& status);

/// Time since it was made.
class Stopwatch {
 public:
  double microseconds() const {
    return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start_)
        .count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// What every call has: its place among the open calls, its deadline, and what its log lines begin
/// with.
class Call {
 public:
  /// Counts the call in; `context` and `state` outlive it.
  Call(State& state, grpc::CallbackServerContext& context, std::string_view method);
  ~Call();
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  /// Whether the call may go on. UNAVAILABLE: the server drains. RESOURCE_EXHAUSTED: too many are
  /// open. UNAUTHENTICATED: it has no token of this server.
  const absl::Status& admission() const { return admission_; }

  /// OK while somebody waits for the answer; else DEADLINE_EXCEEDED or CANCELLED. Safe from any
  /// thread.
  absl::Status Alive() const;

  /// Stops what is still under way for this call, which has failed: Alive() is CANCELLED from now
  /// on.
  void Abandon() { abandoned_ = true; }

  /// When the client gives up; time_point::max() for never.
  std::chrono::system_clock::time_point deadline() const { return deadline_; }

  /// From now on the client has to move, until ClientMoved(): a call that stands still for
  /// ServerOptions::stall is cancelled, and Alive() says why.
  void AwaitClient();
  void ClientMoved();

  /// From now on an upload of this call is under way: where uploads have all of
  /// ServerOptions::build_slots, one that has brought less than kUploadStep bytes in twice
  /// ServerOptions::stall is cancelled, the slowest first, and Alive() says why. Until
  /// UploadEnded().
  static constexpr std::uint64_t kUploadStep = 1 << 20;
  void UploadBrought(std::uint64_t bytes);
  void UploadEnded();

  /// A message of the client is here.
  void MessageCame() { presence_.Moved(); }

  /// The same for the first message of the call, whose memory is counted nowhere: `read`, which
  /// asks gRPC for it, runs once it is the call's turn, see RequestTurns.
  void AwaitRequest(std::function<void()> read);

  /// That message is counted now, or is small: the turn is over.
  void RequestCounted() { turn_ = {}; }

  /// INVALID_ARGUMENT: the metadata x-treelight-map, by which a balancer has chosen this server, is
  /// there and is not `map`.
  absl::Status CheckRoute(std::string_view map) const;

  /// For core; polls Alive().
  CancelCheck cancelled() const;

  /// `status`, but where core was made to stop by `cancelled()`, why.
  absl::Status Explain(const absl::Status& status) const;

  /// A record with what is known of the call: method, peer, request id.
  RequestRecord NewRecord() const;

  /// Writes `record`, of the call or of a batch of it, to the log and to the metrics.
  void Log(RequestRecord& record, const absl::Status& status);

  /// How the call ends; for Finish().
  grpc::Status End(const absl::Status& status);

 private:
  absl::Status Admit();

  State& state_;
  grpc::CallbackServerContext& context_;
  FloodGuard::Presence presence_;
  const std::chrono::system_clock::time_point deadline_;
  absl::Status admission_;  // stays, once constructed
  std::atomic<bool> abandoned_ = false;
  std::atomic<bool> stalled_ = false, late_ = false, slow_ = false;
  std::uint64_t brought_bytes_ = 0;  // of an upload, since the watch was told
  RequestTurns::Turn turn_;
  RequestRecord record_;
  const Stopwatch watch_;
  // Of what was logged; one thread at a time logs.
  std::uint64_t received_bytes_ = 0, sent_bytes_ = 0;
  absl::StatusCode code_ = absl::StatusCode::kUnknown;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_CALL_H_
