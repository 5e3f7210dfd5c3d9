#ifndef TREELIGHT_SERVER_METRICS_ENDPOINT_H_
#define TREELIGHT_SERVER_METRICS_ENDPOINT_H_

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "prometheus/exposer.h"
#include "server/gauges.h"
#include "server/state.h"

namespace treelight::server {

/// HTTP on a port of its own that answers GET /metrics. Its end takes up to two seconds: so often
/// the web server looks whether it shall stop.
class MetricsEndpoint {
 public:
  /// `listen` is "HOST:PORT", port 0 for a free one; `state` outlives the endpoint. UNAVAILABLE:
  /// the address cannot be bound.
  static absl::StatusOr<std::unique_ptr<MetricsEndpoint>> Start(const std::string& listen,
                                                                const State& state);

  int port() const { return exposer_->GetListeningPorts().front(); }

 private:
  explicit MetricsEndpoint(const State& state) : gauges_(std::make_shared<Gauges>(state)) {}

  const std::shared_ptr<Gauges> gauges_;          // the exposer knows it weakly
  std::unique_ptr<prometheus::Exposer> exposer_;  // last: its threads use the rest
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_METRICS_ENDPOINT_H_
