#ifndef TREELIGHT_CLIENT_UPLOAD_CALL_H_
#define TREELIGHT_CLIENT_UPLOAD_CALL_H_

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/client_callback.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::client {

/// One BuildPhotonMap call with blocking steps. Not thread-safe. A server that answers before it
/// has read everything ends a Write at once on any transport; with gRPC's blocking API one in
/// process would wait for ever.
class UploadCall final : private grpc::ClientWriteReactor<v1::BuildPhotonMapRequest> {
 public:
  /// Opens the call on `stub`, to build a map named `map`; it ends at `deadline`,
  /// time_point::max() for never.
  UploadCall(v1::PhotonMapService::Stub& stub, const std::string& map,
             std::chrono::system_clock::time_point deadline);

  /// Waits until the message before is on its way and sends this one, which must stay as it is
  /// until the next Write or Finish returns: the caller prepares the next one meanwhile. False: the
  /// server reads no more, and this one was not sent.
  bool Write(const v1::BuildPhotonMapRequest& request);

  /// Ends the upload, and waits for the answer. Must be called once, and last.
  absl::StatusOr<v1::BuildPhotonMapResponse> Finish();

 private:
  void AwaitWrite();
  void OnWriteDone(bool ok) override;
  void OnDone(const grpc::Status& status) override;

  grpc::ClientContext context_;
  v1::BuildPhotonMapResponse response_;  // owned by gRPC until done_
  bool open_ = true;                     // the server has read everything so far

  std::mutex mutex_;
  std::condition_variable changed_;  // anything below
  bool writing_ = false;             // guarded by mutex_
  bool written_ = true;              // guarded by mutex_; how the last write ended
  bool done_ = false;                // guarded by mutex_
  grpc::Status status_;              // guarded by mutex_; once done_
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_UPLOAD_CALL_H_
