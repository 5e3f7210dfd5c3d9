#ifndef TREELIGHT_CLIENT_STATUS_H_
#define TREELIGHT_CLIENT_STATUS_H_

#include <chrono>
#include <optional>

#include "absl/status/status.h"
#include "grpcpp/support/status.h"

namespace treelight::client {

/// The same code and message; the codes of both have the same numbers. Details of google.rpc.Status
/// become payloads, and where the server says when to repeat, the message ends with it; where TLS
/// is what keeps a connection from coming about, or a size what gRPC refuses, it begins with that.
absl::Status ToAbslStatus(const grpc::Status& status);

/// google.rpc.RetryInfo of `status`: after which time a repeat may succeed. Empty where the server
/// does not say.
std::optional<std::chrono::milliseconds> RetryDelay(const absl::Status& status);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STATUS_H_
