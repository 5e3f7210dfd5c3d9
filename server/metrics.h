#ifndef TREELIGHT_SERVER_METRICS_H_
#define TREELIGHT_SERVER_METRICS_H_

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "prometheus/counter.h"
#include "prometheus/family.h"
#include "prometheus/histogram.h"
#include "prometheus/registry.h"
#include "server/request_log.h"

namespace treelight::server {

/// What is counted as calls come and go, for Prometheus. Names and buckets of calls are those of
/// gRPC's proposal A66 in Prometheus' spelling; labels are methods, codes and stages, never names
/// of maps or ids. Safe to call from several threads at once.
class Metrics {
 public:
  Metrics();

  /// `method` is the last part of its name, "Gather".
  void CallStarted(std::string_view method);

  /// `seconds` from the opening of the call to its end; bytes of its messages.
  void CallEnded(std::string_view method, absl::StatusCode code, double seconds,
                 std::uint64_t received_bytes, std::uint64_t sent_bytes);

  /// A request, that is a call or a batch of a stream, as it is logged: stages, refusals, slow
  /// ones.
  void Request(const RequestRecord& record, const absl::Status& status);

  /// All of it, for a scrape.
  std::shared_ptr<prometheus::Registry> registry() const { return registry_; }

 private:
  void Stage(std::string_view method, std::string_view stage, double microseconds);

  const std::shared_ptr<prometheus::Registry> registry_;
  prometheus::Family<prometheus::Counter>& started_;
  prometheus::Family<prometheus::Histogram>& duration_;
  prometheus::Family<prometheus::Histogram>& received_;
  prometheus::Family<prometheus::Histogram>& sent_;
  prometheus::Family<prometheus::Histogram>& stages_;
  prometheus::Family<prometheus::Counter>& refusals_;
  prometheus::Family<prometheus::Counter>& slow_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_METRICS_H_
