#ifndef TREELIGHT_SERVER_HEALTH_CHECK_H_
#define TREELIGHT_SERVER_HEALTH_CHECK_H_

#include <chrono>
#include <string>

#include "absl/status/status.h"

namespace treelight::server {

/// Asks the server that listens on `listen`, as ServerOptions::listen, whether it serves
/// (grpc.health.v1.Health/Check of the photon map service). An address of all interfaces is asked
/// on loopback. UNAVAILABLE: it says that it does not, or does not answer within `timeout`.
absl::Status CheckHealth(const std::string& listen, std::chrono::milliseconds timeout);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_HEALTH_CHECK_H_
