#include "client/status.h"

#include <span>
#include <string>
#include <string_view>

#include "absl/strings/cord.h"
#include "fmt/format.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace treelight::client {
namespace {

constexpr const char* kRetryUrl = "type.googleapis.com/google.rpc.RetryInfo";

// What gRPC says itself, and what it means.
struct Hint {
  std::string_view symptom, meaning;
};
// Of a connection that did not come about.
constexpr Hint kConnectionHints[] = {
    {"certificate verify failed",
     "the server's certificate is of no CA that is trusted here (--tls-ca), or has expired"},
    {"is not in peer certificate", "the server's certificate is of another host"},
    {"wrong version number", "the server speaks no TLS"},
    {"Socket closed",
     "it hung up at once: does the server want TLS (--tls-ca), or a certificate (--tls-cert)?"},
};
// Of RESOURCE_EXHAUSTED.
constexpr Hint kSizeHints[] = {
    {"metadata size exceeds limit",
     "what goes with a call, the token above all, is over the 8 KiB that a server takes"},
    {"message larger than max",
     "a message is larger than its receiver takes: fewer queries a batch, or a smaller k"},
};

std::string Explain(std::span<const Hint> hints, const std::string& message) {
  for (const Hint& hint : hints) {
    if (message.find(hint.symptom) != std::string::npos)
      return fmt::format("{} ({})", hint.meaning, message);
  }
  return message;
}

// The message of `status`; of gRPC's own with what it means.
std::string Explain(const grpc::Status& status) {
  const std::string message = status.error_message();
  if (message.starts_with("failed to connect to all addresses"))
    return Explain(kConnectionHints, message);
  return status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED ? Explain(kSizeHints, message)
                                                                     : message;
}

}  // namespace

absl::Status ToAbslStatus(const grpc::Status& status) {
  const auto code = static_cast<absl::StatusCode>(status.error_code());
  absl::Status plain(code, Explain(status));
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return plain;
  for (const auto& detail : details.details()) {
    plain.SetPayload(detail.type_url(), absl::Cord(detail.value()));
  }
  const auto delay = RetryDelay(plain);
  if (!delay) return plain;
  absl::Status told(code, fmt::format("{} (the server expects room in {} ms)",
                                      status.error_message(), delay->count()));
  plain.ForEachPayload(
      [&](absl::string_view url, const absl::Cord& payload) { told.SetPayload(url, payload); });
  return told;
}

std::optional<std::chrono::milliseconds> RetryDelay(const absl::Status& status) {
  const auto payload = status.GetPayload(kRetryUrl);
  google::rpc::RetryInfo info;
  if (!payload || !info.ParseFromString(std::string(*payload))) return std::nullopt;
  const auto ms = google::protobuf::util::TimeUtil::DurationToMilliseconds(info.retry_delay());
  return std::chrono::milliseconds(ms < 0 ? 0 : ms);
}

}  // namespace treelight::client
