#ifndef TREELIGHT_SERVER_HEALTH_CHECK_H_
#define TREELIGHT_SERVER_HEALTH_CHECK_H_

#include <chrono>

#include "absl/status/status.h"
#include "server/options.h"

namespace treelight::server {

/// Which server to ask.
struct HealthCheck {
  std::string listen;  ///< as ServerOptions::listen
  TlsFiles tls;        ///< the server's own; with a client CA its certificate must be good for
                       ///< clients too, since it is what is shown
};

/// Asks the server that listens on `check.listen` with the files `check.tls` whether it serves
/// (grpc.health.v1.Health/Check of the photon map service). An address of all interfaces is asked
/// on loopback. UNAVAILABLE: it says that it does not, or does not answer within `timeout`.
absl::Status CheckHealth(const HealthCheck& check, std::chrono::milliseconds timeout);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_HEALTH_CHECK_H_
