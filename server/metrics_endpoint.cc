#include "server/metrics_endpoint.h"

#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "fmt/format.h"

namespace treelight::server {

absl::StatusOr<std::unique_ptr<MetricsEndpoint>> MetricsEndpoint::Start(const std::string& listen,
                                                                        const State& state) {
  std::unique_ptr<MetricsEndpoint> endpoint(new MetricsEndpoint(state));
  // The web server knows addresses by number only.
  const std::string address =
      listen.starts_with("localhost:") ? "127.0.0.1" + listen.substr(listen.find(':')) : listen;
  try {
    // A request that comes half holds a thread for that time: a scrape behind hundreds of them
    // waits for seconds. Each thread takes some KiB.
    endpoint->exposer_ = std::make_unique<prometheus::Exposer>(std::vector<std::string>{
        "listening_ports", address, "num_threads", "64", "request_timeout_ms", "1000"});
  } catch (const std::exception&) {  // says nothing of the cause
    return absl::UnavailableError(
        fmt::format("cannot listen on '{}' (--metrics-listen): the address is taken, not this "
                    "machine's, or not allowed",
                    listen));
  }
  endpoint->exposer_->RegisterCollectable(state.metrics.registry());
  endpoint->exposer_->RegisterCollectable(endpoint->gauges_);
  return endpoint;
}

}  // namespace treelight::server
