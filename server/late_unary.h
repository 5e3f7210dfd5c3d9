#ifndef TREELIGHT_SERVER_LATE_UNARY_H_
#define TREELIGHT_SERVER_LATE_UNARY_H_

#include "grpcpp/support/server_callback.h"
#include "server/call.h"

namespace treelight::server {

/// A call of one request and one response whose request is read once the call is admitted.
///
/// gRPC reads the request of a unary method whole before any handler sees the call, so that whoever
/// connects can have it hold 4 MiB for each stream, and finish none. Here the method is a stream to
/// gRPC, and the same on the wire: tokens, --max-calls and --stall-seconds come before the request.
/// Owns itself: made by the service, gone with OnDone.
template <typename Request, typename Response>
class LateUnary : public grpc::ServerBidiReactor<Request, Response> {
 public:
  void OnDone() final { delete this; }

 protected:
  /// The call itself.
  virtual Call& call() = 0;

  /// Once: OK where request() is here, else why the call fails. Ends with End(). Looks at
  /// Call::admission() where the request is here too: in a drain it is.
  virtual void Run(const absl::Status& status) = 0;

  /// For the end of a constructor: reads the request of a call that is admitted, or comes in a
  /// drain, whose log tells what was refused; then Run().
  void Open() {
    const absl::Status& admission = call().admission();
    if (!admission.ok() && !absl::IsUnavailable(admission)) return Run(admission);
    call().AwaitClient();
    this->StartRead(&request_);
  }

  /// Ends the call as Call::End says, where that is OK with response().
  void End(const grpc::Status& status) {
    if (status.ok()) {
      this->StartWriteAndFinish(&response_, grpc::WriteOptions(), status);
    } else {
      this->Finish(status);
    }
  }

  const Request& request() const { return request_; }
  Response& response() { return response_; }

 private:
  void OnReadDone(bool ok) final {
    call().ClientMoved();
    if (ok) return Run(absl::OkStatus());
    const absl::Status alive = call().Alive();
    Run(alive.ok()
            ? absl::InvalidArgumentError("the call has no request, or one that is no message")
            : alive);
  }

  Request request_;
  Response response_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_LATE_UNARY_H_
