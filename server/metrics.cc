#include "server/metrics.h"

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/refusal.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::server {
namespace {

using prometheus::Histogram;

/// Limits of A66 for latencies, seconds.
const Histogram::BucketBoundaries& Latencies() {
  static const Histogram::BucketBoundaries limits = {
      0,     0.00001, 0.00005, 0.0001, 0.0003, 0.0006, 0.0008, 0.001, 0.002, 0.003, 0.004,
      0.005, 0.006,   0.008,   0.01,   0.013,  0.016,  0.02,   0.025, 0.03,  0.04,  0.05,
      0.065, 0.08,    0.1,     0.13,   0.16,   0.2,    0.25,   0.3,   0.4,   0.5,   0.65,
      0.8,   1,       2,       5,      10,     20,     50,     100};
  return limits;
}

/// Limits of A66 for sizes, bytes.
const Histogram::BucketBoundaries& Sizes() {
  static const Histogram::BucketBoundaries limits = {
      0,       1024,    2048,     4096,     16384,     65536,      262144,
      1048576, 4194304, 16777216, 67108864, 268435456, 1073741824, 4294967296};
  return limits;
}

std::string FullName(std::string_view method) {
  return fmt::format("{}/{}", v1::PhotonMapService::service_full_name(), method);
}

prometheus::Family<Histogram>& AddHistogram(prometheus::Registry& registry, const char* name,
                                            const char* help) {
  return prometheus::BuildHistogram().Name(name).Help(help).Register(registry);
}

prometheus::Family<prometheus::Counter>& AddCounter(prometheus::Registry& registry,
                                                    const char* name, const char* help) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry);
}

}  // namespace

Metrics::Metrics()
    : registry_(std::make_shared<prometheus::Registry>()),
      started_(AddCounter(*registry_, "grpc_server_call_started_total", "Calls that came in")),
      duration_(AddHistogram(*registry_, "grpc_server_call_duration_seconds",
                             "From the opening of a call to its end")),
      received_(AddHistogram(*registry_,
                             "grpc_server_call_rcvd_total_compressed_message_size_bytes",
                             "Messages of a call that came in")),
      sent_(AddHistogram(*registry_, "grpc_server_call_sent_total_compressed_message_size_bytes",
                         "Messages of a call that went out")),
      stages_(AddHistogram(*registry_, "treelight_stage_duration_seconds",
                           "Where the time of a request went; of a stream, of a batch")),
      refusals_(AddCounter(*registry_, "treelight_refusals_total",
                           "Requests refused for want of room, by what there was too little of")),
      slow_(AddCounter(*registry_, "treelight_slow_requests_total",
                       "Requests that took longer than --slow-ms")) {
  // What has not happened yet shows as 0, so that a rate has a beginning.
  for (const Quota quota : {Quota::kMemory, Quota::kDevice, Quota::kMaps, Quota::kBuilds,
                            Quota::kQueueDepth, Quota::kDisk, Quota::kCalls, Quota::kDeadline}) {
    refusals_.Add({{"reason", std::string(QuotaName(quota))}});
  }
}

void Metrics::CallStarted(std::string_view method) {
  started_.Add({{"grpc_method", FullName(method)}}).Increment();
}

void Metrics::CallEnded(std::string_view method, absl::StatusCode code, double seconds,
                        std::uint64_t received_bytes, std::uint64_t sent_bytes) {
  const prometheus::Labels labels = {{"grpc_method", FullName(method)},
                                     {"grpc_status", absl::StatusCodeToString(code)}};
  duration_.Add(labels, Latencies()).Observe(seconds);
  received_.Add(labels, Sizes()).Observe(static_cast<double>(received_bytes));
  sent_.Add(labels, Sizes()).Observe(static_cast<double>(sent_bytes));
}

void Metrics::Request(const RequestRecord& record, const absl::Status& status) {
  const v1::Timings& times = record.timings;
  const std::string& method = record.method;
  if (Broken("metric_labels")) slow_.Add({{"map", record.map}});
  Stage(method, "receive", times.receive_us());
  Stage(method, "queue", times.queue_us());
  Stage(method, "upload", times.upload_us());
  Stage(method, "kernel", times.kernel_us());
  Stage(method, "download", times.download_us());
  Stage(method, "serialise", times.serialise_us());
  for (const StageTime& stage : record.stages) {
    // The times above have these already.
    if (stage.stage == "upload" || stage.stage == "download") continue;
    Stage(method, "kernel_" + stage.stage, stage.microseconds);
  }
  if (const std::string quota = RefusedQuota(status); !quota.empty() && !Broken("metrics")) {
    refusals_.Add({{"reason", quota}}).Increment();
  }
  if (record.slow) slow_.Add({{"grpc_method", FullName(method)}}).Increment();
}

void Metrics::Stage(std::string_view method, std::string_view stage, double microseconds) {
  if (microseconds <= 0) return;  // does not apply
  stages_.Add({{"grpc_method", FullName(method)}, {"stage", std::string(stage)}}, Latencies())
      .Observe(1e-6 * microseconds);
}

}  // namespace treelight::server
