#ifndef TREELIGHT_SERVER_GAUGES_H_
#define TREELIGHT_SERVER_GAUGES_H_

#include <vector>

#include "prometheus/collectable.h"
#include "server/state.h"

namespace treelight::server {

/// What the server holds at the moment of a scrape: maps, photons, memory, queue, open calls.
class Gauges final : public prometheus::Collectable {
 public:
  /// `state` outlives it.
  explicit Gauges(const State& state) : state_(state) {}

  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  const State& state_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_GAUGES_H_
