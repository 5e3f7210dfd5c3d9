#include "server/refusal.h"

#include "absl/strings/cord.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "server/break_switch.h"

namespace treelight::server {
namespace {

constexpr const char* kQuotaUrl = "type.googleapis.com/google.rpc.QuotaFailure";
constexpr const char* kRetryUrl = "type.googleapis.com/google.rpc.RetryInfo";

}  // namespace

std::string_view QuotaName(Quota quota) {
  switch (quota) {
    case Quota::kMemory:
      return "memory";
    case Quota::kDevice:
      return "device";
    case Quota::kBuilds:
      return "builds";
    case Quota::kQueueDepth:
      return "queue";
    case Quota::kDisk:
      return "disk";
    case Quota::kCalls:
      return "calls";
    case Quota::kDeadline:
      return "deadline";
    case Quota::kMaps:
      return "maps";
  }
  return "";
}

absl::Status Refuse(Quota quota, std::string_view message,
                    std::optional<std::chrono::milliseconds> retry_delay) {
  absl::Status status(absl::StatusCode::kResourceExhausted, {message.data(), message.size()});
  google::rpc::QuotaFailure failure;
  auto& violation = *failure.add_violations();
  violation.set_subject(std::string(QuotaName(quota)));
  violation.set_description(std::string(message));
  status.SetPayload(kQuotaUrl, absl::Cord(failure.SerializeAsString()));
  if (retry_delay && !Broken("retry_info")) {
    google::rpc::RetryInfo retry;
    *retry.mutable_retry_delay() =
        google::protobuf::util::TimeUtil::MillisecondsToDuration(retry_delay->count());
    status.SetPayload(kRetryUrl, absl::Cord(retry.SerializeAsString()));
  }
  return status;
}

std::string RefusedQuota(const absl::Status& status) {
  const auto payload = status.GetPayload(kQuotaUrl);
  google::rpc::QuotaFailure failure;
  if (!payload || !failure.ParseFromString(std::string(*payload)) || failure.violations().empty()) {
    return {};
  }
  return failure.violations(0).subject();
}

google::rpc::Status ToRpcStatus(const absl::Status& status) {
  google::rpc::Status wire;
  wire.set_code(static_cast<int>(status.code()));
  wire.set_message(std::string(status.message()));
  status.ForEachPayload([&](absl::string_view url, const absl::Cord& payload) {
    auto& detail = *wire.add_details();
    detail.set_type_url(std::string(url));
    detail.set_value(std::string(payload));
  });
  return wire;
}

}  // namespace treelight::server
