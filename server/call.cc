#include "server/call.h"

#include <random>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/convert.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

/// The metadata by which a client names a request, in all calls but BuildPhotonMap, whose header
/// has a field.
constexpr const char* kRequestIdKey = "x-request-id";
constexpr const char* kAuthorizationKey = "authorization";

/// The metadata by which balancers send all calls of one map to one server.
constexpr const char* kMapKey = "x-treelight-map";

/// 16 random hexadecimal digits.
std::string RandomId() {
  thread_local std::mt19937_64 engine{std::random_device{}()};
  return fmt::format("{:016x}", engine());
}

/// The first value of `key` that the client has sent; empty where there is none.
std::string_view Metadata(const grpc::CallbackServerContext& context, const char* key) {
  const auto& metadata = context.client_metadata();
  const auto entry = metadata.find(key);
  if (entry == metadata.end()) return {};
  return {entry->second.data(), entry->second.size()};
}

/// The client's id where it gave one that may stand in a log, else a random one.
std::string RequestId(const grpc::CallbackServerContext& context) {
  const std::string_view id = Metadata(context, kRequestIdKey);
  return CheckName(kRequestIdKey, id).ok() ? std::string(id) : RandomId();
}

}  // namespace

grpc::Status ToGrpcStatus(const absl::Status& status) {
  const google::rpc::Status wire = ToRpcStatus(status);
  return {static_cast<grpc::StatusCode>(status.code()), std::string(status.message()),
          wire.details().empty() ? std::string() : wire.SerializeAsString()};
}

Call::Call(State& state, grpc::CallbackServerContext& context, std::string_view method)
    : state_(state),
      context_(context),
      presence_(state.floods, context.peer()),
      deadline_(context.deadline()) {
  record_.request_id = RequestId(context);
  record_.method = method;
  record_.peer = context.peer();
  admission_ = Admit();
  state_.metrics.CallStarted(record_.method);
}

absl::Status Call::Admit() {
  const absl::Status entered = state_.calls.Enter();  // in any case: the end counts it out
  if (state_.tokens != nullptr) {
    const auto client = state_.tokens->Authenticate(Metadata(context_, kAuthorizationKey));
    if (!client.ok()) return client.status();
    record_.client = *client;
  }
  return entered;
}

Call::~Call() {
  ClientMoved();  // nobody ends the call from here on
  UploadEnded();
  RequestCounted();
  state_.metrics.CallEnded(record_.method, code_, 1e-6 * watch_.microseconds(), received_bytes_,
                           sent_bytes_);
  if (!(Broken("open_calls") && code_ == absl::StatusCode::kCancelled)) state_.calls.Leave();
}

absl::Status Call::CheckRoute(std::string_view map) const {
  const auto [first, last] = context_.client_metadata().equal_range(kMapKey);
  for (auto entry = first; entry != last; ++entry) {
    const std::string_view key(entry->second.data(), entry->second.size());
    if (key == map || Broken("route")) continue;
    // A status travels in HTTP/2 headers, which are limited.
    return absl::InvalidArgumentError(fmt::format(
        "metadata {} is '{}', the map of the request '{}': calls of one map must go to one server; "
        "send the name of the map, or no such metadata",
        kMapKey, key.substr(0, kMaxNameLength), map.substr(0, kMaxNameLength)));
  }
  return absl::OkStatus();
}

void Call::AwaitClient() {
  state_.stalls.Wait(this, [this] {
    stalled_ = true;
    context_.TryCancel();
  });
}

void Call::ClientMoved() {
  state_.stalls.Arrived(this);
  state_.turns.Arrived(this);
}

void Call::UploadBrought(std::uint64_t bytes) {
  brought_bytes_ += bytes;
  if (bytes > 0 && brought_bytes_ < kUploadStep) return;
  brought_bytes_ = 0;
  state_.uploads.Wait(this, [this] {
    slow_ = true;
    context_.TryCancel();
  });
}

void Call::UploadEnded() { state_.uploads.Arrived(this); }

void Call::AwaitRequest(std::function<void()> read) {
  state_.turns.Await(
      this,
      [this] {
        late_ = true;
        context_.TryCancel();
      },
      [this, read = std::move(read)](RequestTurns::Turn turn) {
        turn_ = std::move(turn);
        read();
      });
}

absl::Status Call::Alive() const {
  if (std::chrono::system_clock::now() >= deadline_) {
    return absl::DeadlineExceededError("the deadline of the call has passed; the work was stopped");
  }
  if (stalled_) {
    return absl::CancelledError(
        fmt::format("the client has neither sent nor taken anything for {} ms (--stall-seconds)",
                    state_.stalls.patience().count()));
  }
  if (slow_) {
    return absl::CancelledError(fmt::format(
        "the upload brought less than {} bytes in {} ms (twice --stall-seconds) while as many "
        "uploads were open as there are slots, {} (--build-slots)",
        kUploadStep, 2 * state_.stalls.patience().count(), state_.options.build_slots));
  }
  if (late_) {
    return absl::CancelledError(fmt::format(
        "the request was not here after {} ms (--stall-seconds), or after {} ms while of the {} "
        "that may be on their way at once most were",
        state_.stalls.patience().count(), RequestTurns::kGrace.count(), state_.turns.most()));
  }
  if (context_.IsCancelled()) return absl::CancelledError("the client has cancelled the call");
  if (abandoned_) return absl::CancelledError("an earlier batch of the stream has failed");
  return absl::OkStatus();
}

CancelCheck Call::cancelled() const {
  return [this] { return !Alive().ok(); };
}

absl::Status Call::Explain(const absl::Status& status) const {
  if (!absl::IsCancelled(status)) return status;
  const absl::Status reason = Alive();
  return reason.ok() ? status : reason;
}

RequestRecord Call::NewRecord() const { return record_; }

void Call::Log(RequestRecord& record, const absl::Status& status) {
  const auto slow = std::chrono::duration<double, std::micro>(state_.options.slow);
  record.slow = slow.count() > 0 && record.timings.total_us() > slow.count();
  received_bytes_ += record.bytes_in;
  sent_bytes_ += record.bytes_out;
  state_.metrics.Request(record, status);
  state_.log->Write(record, status);
}

grpc::Status Call::End(const absl::Status& status) {
  code_ = status.code();
  if (Broken("dropped_connection") && absl::IsCancelled(status)) std::abort();
  return ToGrpcStatus(status);
}

}  // namespace treelight::server
