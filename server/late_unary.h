#ifndef TREELIGHT_SERVER_LATE_UNARY_H_
#define TREELIGHT_SERVER_LATE_UNARY_H_

#include <cstddef>

#include "fmt/format.h"
#include "grpcpp/support/server_callback.h"
#include "server/call.h"

namespace treelight::server {

/// A call of one request and one response whose request is read once the call is admitted.
///
/// gRPC reads the request of a unary method whole before any handler sees the call, so that whoever
/// connects can have it hold 4 MiB for each stream, and finish none. Here the method is a stream to
/// gRPC, and the same on the wire: tokens, --max-calls and a turn (RequestTurns) come before the
/// request.
/// Owns itself: made by the service, gone with OnDone.
template <typename Request, typename Response>
class LateUnary : public grpc::ServerBidiReactor<Request, Response> {
 public:
  void OnDone() final { delete this; }

 protected:
  /// What a request has that only names things.
  static constexpr std::size_t kFewBytes = 1 << 16;

  /// The call itself.
  virtual Call& call() = 0;

  /// Once: OK where request() is here, else why the call fails. Ends with End(). Looks at
  /// Call::admission() where the request is here too: in a drain it is.
  virtual void Run(const absl::Status& status) = 0;

  /// For the end of a constructor: reads the request of a call that is admitted, or comes in a
  /// drain, whose log tells what was refused; then Run(). Of a request of more than `max_bytes`
  /// nothing is kept. One of more than kFewBytes is for Run() to count: Call::RequestCounted.
  void Open(std::size_t max_bytes = kFewBytes) {
    max_bytes_ = max_bytes;
    const absl::Status& admission = call().admission();
    if (!admission.ok() && !absl::IsUnavailable(admission)) return Run(admission);
    call().AwaitRequest([this] { this->StartRead(&request_); });
  }

  /// Ends the call as Call::End says, where that is OK with response(). A client that does not take
  /// it loses the call, and what it holds.
  void End(const grpc::Status& status) {
    call().AwaitClient();
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
    if (!ok) {
      const absl::Status alive = call().Alive();
      return Run(alive.ok() ? absl::InvalidArgumentError(
                                  "the call has no request, or one that is no message")
                            : alive);
    }
    call().MessageCame();
    const std::size_t bytes = request_.ByteSizeLong();
    if (bytes <= kFewBytes) call().RequestCounted();
    if (bytes <= max_bytes_) return Run(absl::OkStatus());
    Request().Swap(&request_);
    call().RequestCounted();
    Run(absl::InvalidArgumentError(fmt::format(
        "the request has {} bytes, one of this method has {} at most", bytes, max_bytes_)));
  }

  std::size_t max_bytes_ = 0;
  Request request_;
  Response response_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_LATE_UNARY_H_
