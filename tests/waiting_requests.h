#ifndef TREELIGHT_TESTS_WAITING_REQUESTS_H_
#define TREELIGHT_TESTS_WAITING_REQUESTS_H_

#include <string>

#include "server/server.h"
#include "tests/http_get.h"

namespace treelight::testing {

/// Requests that wait for the device of `server`, which has a port for metrics.
inline std::size_t WaitingRequests(const server::Server& server) {
  const std::string metrics = HttpGet(server.metrics_port(), "/metrics");
  const std::string name = "\ntreelight_device_queue_depth ";
  const std::size_t at = metrics.find(name);
  return at == std::string::npos ? 0 : std::stoul(metrics.substr(at + name.size()));
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_WAITING_REQUESTS_H_
