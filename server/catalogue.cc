#include "server/catalogue.h"

#include <numeric>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "server/answer.h"
#include "server/convert.h"
#include "server/persistence.h"
#include "server/version.h"

namespace treelight::server {

absl::Status GetPhotonMap(State& state, const v1::GetPhotonMapRequest& request,
                          v1::PhotonMap& response) {
  if (auto status = CheckName("name", request.name()); !status.ok()) return status;
  const auto map = state.store.Find(request.name(), request.version());
  if (!map.ok()) return map.status();
  response = ToWire(**map);
  return absl::OkStatus();
}

absl::Status ListPhotonMaps(State& state, const v1::ListPhotonMapsRequest&,
                            v1::ListPhotonMapsResponse& response) {
  for (const MapHandle& map : state.store.List()) *response.add_maps() = ToWire(*map);
  const std::uint64_t limit = state.options.limits.max_message_bytes;
  if (response.ByteSizeLong() + kEnvelopeBytes <= limit) return absl::OkStatus();
  return absl::ResourceExhaustedError(fmt::format(
      "the list of {} maps takes {} bytes, the limit of a message is {}; delete maps, or give "
      "them a time to live",
      response.maps_size(), response.ByteSizeLong(), limit));
}

absl::Status DeletePhotonMap(State& state, const v1::DeletePhotonMapRequest& request,
                             v1::DeletePhotonMapResponse& response) {
  if (auto status = CheckName("name", request.name()); !status.ok()) return status;
  auto removed = RemoveMaps(state, request.name(), request.version());
  if (!removed.ok()) return removed.status();
  response.set_deleted(static_cast<std::uint32_t>(removed->size()));
  // Device memory is freed on another thread, as this one is gRPC's: the maps go with the task.
  state.cpu.enqueue([maps = *std::move(removed)] {});
  return absl::OkStatus();
}

absl::Status GetServerInfo(State& state, const v1::GetServerInfoRequest&,
                           v1::ServerInfo& response) {
  const std::vector<MapHandle> maps = state.store.List();
  response.set_version(kVersion);
  for (const DeviceInfo& device : state.options.devices) *response.add_devices() = ToWire(device);
  response.set_device_index(state.options.device_index);
  *response.mutable_limits() = ToWire(state.options.limits);
  const auto uptime = std::chrono::steady_clock::now() - state.started;
  response.set_uptime_ms(std::chrono::duration_cast<std::chrono::milliseconds>(uptime).count());
  response.set_map_count(static_cast<std::uint32_t>(maps.size()));
  std::uint64_t photon_count = 0;
  for (const MapHandle& map : maps) photon_count += map->gatherer->photon_count();
  response.set_photon_count(photon_count);
  response.set_device_bytes_used(DeviceBytes(maps));
  const MemoryBudget::Usage usage = state.memory.usage();
  response.set_memory_bytes_used(std::accumulate(usage.begin(), usage.end(), std::uint64_t{0}));
  response.mutable_limits()->set_memory_bytes(state.memory.limit_bytes());
  response.mutable_limits()->set_build_slots(static_cast<std::uint32_t>(state.options.build_slots));
  return absl::OkStatus();
}

}  // namespace treelight::server
