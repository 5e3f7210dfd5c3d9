#include "server/health.h"

#include <chrono>
#include <cstddef>

#include "fmt/format.h"
#include "grpcpp/support/server_callback.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::server {
namespace {

using Request = grpc::health::v1::HealthCheckRequest;

/// Of requests that are on their way; gRPC 1.51 limits the size of messages, 4 MiB, for all methods
/// alike.
constexpr std::size_t kMaxRequests = 16;
constexpr std::chrono::seconds kRequestPatience{2};
/// The name of a service and a few bytes.
constexpr std::size_t kMaxRequestBytes = 1024;
/// Those who watch may do so for ever, but for the oldest of too many, who come again.
constexpr std::size_t kMaxWatches = 1024;
constexpr std::chrono::hours kForever{100'000};

/// Methods in the order of health.proto.
constexpr int kCheck = 0, kWatch = 1;

}  // namespace

/// A call whose request is read as a message of a stream (see LateUnary). Owns itself: made by the
/// service, gone with OnDone.
class Health::OneCall : public grpc::ServerBidiReactor<Request, Response> {
 public:
  OneCall(Health& health, grpc::CallbackServerContext& context)
      : health_(health), context_(context), presence_(health.floods_, context.peer()) {
    EndWhereLate(health_.requests_);
    StartRead(&request_);
  }

  void OnReadDone(bool ok) final {
    health_.requests_.Arrived(this);
    if (!ok) {
      return End({grpc::StatusCode::INVALID_ARGUMENT,
                  "the call has no request, or one that is no message"});
    }
    presence_.Moved();
    if (const std::size_t bytes = request_.ByteSizeLong(); bytes > kMaxRequestBytes) {
      return End({grpc::StatusCode::INVALID_ARGUMENT,
                  fmt::format("the request has {} bytes: a health request names a service and has "
                              "{} at most",
                              bytes, kMaxRequestBytes)});
    }
    Run(request_.service());
  }

  void OnDone() final {
    health_.stalls_.Arrived(this);
    health_.watches_.Arrived(this);
    delete this;
  }

 protected:
  /// Answers for `service`.
  virtual void Run(const std::string& service) = 0;

  /// Ends the call without an answer.
  virtual void End(const grpc::Status& status) { Finish(status); }

  /// Cancels the call where `watch` finds its client late. A status would have to be sent, to a
  /// client that may take nothing.
  void EndWhereLate(StallWatch& watch) {
    watch.Wait(this, [this] { context_.TryCancel(); });
  }

  Health& health_;
  Response response_;

 private:
  grpc::CallbackServerContext& context_;
  FloodGuard::Presence presence_;
  Request request_;
};

class Health::CheckCall final : public OneCall {
 public:
  using OneCall::OneCall;

 private:
  void Run(const std::string& service) override {
    if (!IsKnown(service)) {
      return End({grpc::StatusCode::NOT_FOUND,
                  fmt::format("there is no service '{}' here; ask for {}, or for '', the server",
                              service, v1::PhotonMapService::service_full_name())});
    }
    {
      const std::lock_guard lock(health_.mutex_);
      response_.set_status(health_.status_);
    }
    EndWhereLate(health_.stalls_);
    StartWriteAndFinish(&response_, grpc::WriteOptions(), grpc::Status::OK);
  }
};

class Health::WatchCall final : public OneCall {
 public:
  using OneCall::OneCall;

  /// Writes the status where the client does not have it. Needs Health's mutex; gRPC runs no
  /// reaction inside of StartWrite.
  void Tell() {
    const auto status = known_ ? health_.status_ : Response::SERVICE_UNKNOWN;
    if (writing_ || status == response_.status()) return;
    writing_ = true;
    response_.set_status(status);
    EndWhereLate(health_.stalls_);
    StartWrite(&response_);
  }

  void OnWriteDone(bool ok) override {
    health_.stalls_.Arrived(this);
    const std::lock_guard lock(health_.mutex_);
    writing_ = false;
    if (ok && !ended_) Tell();
  }

  void OnCancel() override { End(grpc::Status::CANCELLED); }

 private:
  void Run(const std::string& service) override {
    EndWhereLate(health_.watches_);
    const std::lock_guard lock(health_.mutex_);
    if (ended_) return;
    known_ = IsKnown(service);
    health_.watching_.insert(this);
    Tell();
  }

  void End(const grpc::Status& status) override {
    {
      const std::lock_guard lock(health_.mutex_);
      if (ended_) return;
      ended_ = true;
      health_.watching_.erase(this);
    }
    Finish(status);
  }

  // Guarded by Health's mutex, as is the response.
  bool known_ = false, writing_ = false, ended_ = false;
};

template <typename Handler>
void Health::Handle(int method) {
  MarkMethodStreamed(method, nullptr);
  MarkMethodCallback(method, new grpc::internal::CallbackBidiHandler<Request, Response>(
                                 [this](grpc::CallbackServerContext* context) {
                                   return new Handler(*this, *context);
                                 }));
}

Health::Health(StallWatch& stalls, FloodGuard& floods)
    : stalls_(stalls),
      floods_(floods),
      requests_(kRequestPatience, kMaxRequests),
      watches_(kForever, kMaxWatches) {
  Handle<CheckCall>(kCheck);
  Handle<WatchCall>(kWatch);
}

void Health::Close() {
  const std::lock_guard lock(mutex_);
  status_ = Response::NOT_SERVING;
  for (WatchCall* const call : watching_) call->Tell();
}

bool Health::IsKnown(std::string_view service) {
  return service.empty() || service == v1::PhotonMapService::service_full_name();
}

}  // namespace treelight::server
