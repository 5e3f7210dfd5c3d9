#ifndef TREELIGHT_CLIENT_STATUS_H_
#define TREELIGHT_CLIENT_STATUS_H_

#include "absl/status/status.h"
#include "grpcpp/support/status.h"

namespace treelight::client {

/// The same code and message; the codes of both have the same numbers.
inline absl::Status ToAbslStatus(const grpc::Status& status) {
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STATUS_H_
