#ifndef TREELIGHT_SERVER_REFUSAL_H_
#define TREELIGHT_SERVER_REFUSAL_H_

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "google/rpc/status.pb.h"

// Refusals of what the server has no room for at present: RESOURCE_EXHAUSTED with google.rpc's
// QuotaFailure and RetryInfo, which travel as payloads of absl::Status until they become
// grpc-status-details-bin.
namespace treelight::server {

/// What there is too little of; the subject of the QuotaFailure.
enum class Quota {
  kMemory,      ///< "memory": host memory, --memory-limit
  kDevice,      ///< "device": memory of a device that has its own
  kBuilds,      ///< "builds": open uploads and builds, --build-slots
  kQueueDepth,  ///< "queue": requests that wait for the device, --queue-depth
  kDisk,        ///< "disk": room in --data-dir
  kCalls,       ///< "calls": open calls of any kind, --max-calls
  kDeadline,    ///< "deadline": the queue is longer than the time that the caller has
  kMaps,        ///< "maps": versions of maps, whose number --memory-limit bounds
};

/// "memory", "device", "builds", "queue", "disk", "calls", "deadline", "maps".
std::string_view QuotaName(Quota quota);

/// RESOURCE_EXHAUSTED. `message` says the limit, what was asked and what to do; it is the
/// description of the QuotaFailure too. With `retry_delay`: a RetryInfo; without, no repeat helps.
absl::Status Refuse(Quota quota, std::string_view message,
                    std::optional<std::chrono::milliseconds> retry_delay);

/// Subject of the first QuotaFailure of `status`; empty where it has none.
std::string RefusedQuota(const absl::Status& status);

/// `status` with all of its payloads, as it travels.
google::rpc::Status ToRpcStatus(const absl::Status& status);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_REFUSAL_H_
