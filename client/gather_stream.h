#ifndef TREELIGHT_CLIENT_GATHER_STREAM_H_
#define TREELIGHT_CLIENT_GATHER_STREAM_H_

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/gather_wire.h"
#include "client/photon_map_client.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/client_callback.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::client {

/// One GatherStream call. Answers are read all the time, whatever the caller does, so that a caller
/// who sends and a server that answers never wait for each other; an answer waits in memory until
/// it is received. Not thread-safe.
class GatherStream final : private grpc::ClientBidiReactor<v1::GatherRequest, v1::GatherResponse> {
 public:
  /// Opens the call on `stub`, which must outlive it, for batches of map `map`. The call ends at
  /// `deadline`, time_point::max() for never; each Send and each Receive waits at most `patience`,
  /// zero for any time.
  GatherStream(v1::PhotonMapService::Stub& stub, const std::string& map,
               std::chrono::system_clock::time_point deadline, std::chrono::milliseconds patience);
  /// Cancels what was not received.
  ~GatherStream() override;

  /// Begins to send a batch once the one before it is sent. Returns the error that ended the
  /// stream.
  absl::Status Send(v1::GatherRequest request);

  /// Waits for the answer to the oldest batch that was sent and not received. FAILED_PRECONDITION:
  /// there is none. Else the error that ended the stream; INTERNAL: the server's answer is
  /// malformed.
  absl::StatusOr<GatherAnswer> Receive();

 private:
  void OnWriteDone(bool ok) override;
  void OnWritesDoneDone(bool ok) override { OnWriteDone(ok); }
  void OnReadDone(bool ok) override;
  void OnDone(const grpc::Status& status) override;

  // Waits until `ready` says so. DEADLINE_EXCEEDED, and the call cancelled, where that takes longer
  // than patience_.
  absl::Status Wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& ready);
  absl::Status Failure() const;  // why a stream that is done is done; needs mutex_

  grpc::ClientContext context_;
  const std::chrono::milliseconds patience_;
  v1::GatherRequest request_;    // while writing_: owned by gRPC
  v1::GatherResponse response_;  // owned by the reading callbacks

  std::mutex mutex_;
  std::condition_variable changed_;     // anything below
  std::deque<AnswerAssembly> pending_;  // guarded by mutex_; batches sent, not answered
  std::deque<GatherAnswer> answers_;    // guarded by mutex_; not received
  bool writing_ = false;                // guarded by mutex_
  bool read_all_ = false;               // guarded by mutex_; the server sends no more
  bool done_ = false;                   // guarded by mutex_; OnDone was called
  absl::Status failure_;                // guarded by mutex_; found by this side
  grpc::Status status_;                 // guarded by mutex_; of the server, once done_
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_GATHER_STREAM_H_
