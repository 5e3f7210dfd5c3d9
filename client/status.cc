#include "client/status.h"

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

// What gRPC says of a connection that did not come about, and what it means.
struct Hint {
  std::string_view symptom, meaning;
};
constexpr Hint kHints[] = {
    {"certificate verify failed",
     "the server's certificate is of no CA that is trusted here (--tls-ca), or has expired"},
    {"is not in peer certificate", "the server's certificate is of another host"},
    {"wrong version number", "the server speaks no TLS"},
    {"Socket closed",
     "it hung up at once: does the server want TLS (--tls-ca), or a certificate (--tls-cert)?"},
};

// `message` of gRPC, of a connection that failed with what it means.
std::string Explain(const std::string& message) {
  if (!message.starts_with("failed to connect to all addresses")) return message;
  for (const Hint& hint : kHints) {
    if (message.find(hint.symptom) != std::string::npos) {
      return fmt::format("{} ({})", hint.meaning, message);
    }
  }
  return message;
}

}  // namespace

absl::Status ToAbslStatus(const grpc::Status& status) {
  const auto code = static_cast<absl::StatusCode>(status.error_code());
  absl::Status plain(code, Explain(status.error_message()));
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
