#include "server/gauges.h"

#include <string>
#include <utility>

namespace treelight::server {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;

ClientMetric Value(double value, std::vector<ClientMetric::Label> labels = {}) {
  ClientMetric metric;
  metric.label = std::move(labels);
  metric.gauge.value = value;
  return metric;
}

MetricFamily Gauge(const char* name, const char* help, std::vector<ClientMetric> metrics) {
  return {.name = name,
          .help = help,
          .type = prometheus::MetricType::Gauge,
          .metric = std::move(metrics)};
}

MetricFamily Gauge(const char* name, const char* help, double value) {
  return Gauge(name, help, std::vector{Value(value)});
}

std::vector<ClientMetric> ByHolder(const MemoryBudget::Usage& usage) {
  std::vector<ClientMetric> metrics;
  for (std::size_t i = 0; i < usage.size(); ++i) {
    const auto name = HolderName(static_cast<Holder>(i));
    metrics.push_back(Value(static_cast<double>(usage[i]), {{"holder", std::string(name)}}));
  }
  return metrics;
}

}  // namespace

std::vector<MetricFamily> Gauges::Collect() const {
  const auto maps = state_.store.List();
  double photon_count = 0;
  for (const MapHandle& map : maps) {
    photon_count += static_cast<double>(map->gatherer->photon_count());
  }
  std::vector<MetricFamily> families = {
      Gauge("treelight_maps", "Versions of maps", static_cast<double>(maps.size())),
      Gauge("treelight_photons", "Photons in all maps", photon_count),
      Gauge("treelight_device_memory_used_bytes", "Device memory that maps hold",
            static_cast<double>(DeviceBytes(maps))),
      Gauge("treelight_memory_held_bytes", "Host memory of --memory-limit that is held, by what",
            ByHolder(state_.memory.usage())),
      Gauge("treelight_memory_limit_bytes", "--memory-limit",
            static_cast<double>(state_.memory.limit_bytes())),
      Gauge("treelight_device_queue_depth", "Requests that wait for the device",
            static_cast<double>(state_.device_queue.waiting())),
      Gauge("treelight_device_queue_backlog_seconds",
            "What the requests at the device and before it will take, as far as is known",
            1e-6 * static_cast<double>(state_.device_queue.backlog().count())),
      Gauge("treelight_open_builds", "Builds from their header to their answer",
            static_cast<double>(state_.build_slots.taken())),
      Gauge("treelight_open_calls", "Calls that have not ended",
            static_cast<double>(state_.calls.open())),
      Gauge("treelight_open_connections", "Connections of clients",
            static_cast<double>(state_.connections.open()))};
  if (!state_.options.devices.empty()) {
    const DeviceInfo& device = state_.options.devices[state_.options.device_index];
    families.push_back(Gauge("treelight_device_memory_bytes", "Memory of the device",
                             static_cast<double>(device.memory_bytes)));
  }
  return families;
}

}  // namespace treelight::server
