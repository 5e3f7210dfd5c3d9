#include "server/residency.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/upload.h"

namespace treelight::server {

std::uint64_t EvictIdleMaps(State& state, std::uint64_t bytes) {
  std::vector<MapHandle> maps = state.store.List();
  std::erase_if(maps, [](const MapHandle& map) {
    return map->reloadable == nullptr || !map->reloadable->resident();
  });
  std::ranges::sort(maps, {}, [](const MapHandle& map) { return map->reloadable->last_use(); });
  std::uint64_t freed = 0;
  for (const MapHandle& map : maps) {
    if (freed >= bytes) break;
    if (const auto tree = map->reloadable->Evict()) freed += tree->gatherer->report().device_bytes;
  }
  return freed;
}

absl::StatusOr<std::shared_ptr<const ResidentTree>> LoadTree(State& state, const BuildPlan& plan,
                                                             const ReloadableMap::ReadFrom& read,
                                                             const CancelCheck& cancelled) {
  const std::string what =
      fmt::format("map '{}' with {} photons is not on the device", plan.name, plan.photon_count);
  const std::uint64_t map_bytes = MapBytes(plan);
  if (!state.options.devices.empty()) {
    const auto room = WithEviction(state, map_bytes, [&] {
      return CheckDeviceRoom(plan, state.options.devices[state.options.device_index],
                             DeviceBytes(state.store.List()), what);
    });
    if (!room.ok()) return room;
  }
  const std::uint64_t held_bytes = state.maps_in_host_memory() ? map_bytes : 0;
  const std::uint64_t all_bytes =
      PhotonBytes(plan) + state.builder->WorkBytes(plan.options, plan.photon_count) + held_bytes;
  auto memory = WithEviction(state, all_bytes, [&] {
    return state.memory.Take(Holder::kUploads, all_bytes, what, state.device_queue.RetryDelay());
  });
  if (!memory.ok()) return memory.status();
  MemoryBudget::Share held = memory->Split(Holder::kMaps, held_bytes);
  const auto photons = read();
  if (!photons.ok()) return photons.status();
  BuildOptions options = plan.options;
  if (Broken("same_tree")) options.max_leaf_size += 1;
  auto gatherer = WithEviction(state, map_bytes,
                               [&] { return state.builder->Build(*photons, options, cancelled); });
  if (!gatherer.ok()) return gatherer.status();
  if (state.maps_in_host_memory()) held.Resize((*gatherer)->report().device_bytes);
  return std::make_shared<const ResidentTree>(
      ResidentTree{.gatherer = *std::move(gatherer), .memory = std::move(held)});
}

}  // namespace treelight::server
