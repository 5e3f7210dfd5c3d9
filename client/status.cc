#include "client/status.h"

#include <string>

#include "absl/strings/cord.h"
#include "fmt/format.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace treelight::client {
namespace {

constexpr const char* kRetryUrl = "type.googleapis.com/google.rpc.RetryInfo";

}  // namespace

absl::Status ToAbslStatus(const grpc::Status& status) {
  const auto code = static_cast<absl::StatusCode>(status.error_code());
  absl::Status plain(code, status.error_message());
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
