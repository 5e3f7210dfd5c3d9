#include "server/residency.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/upload.h"

namespace treelight::server {

std::uint64_t EvictIdleMaps(State& state, std::uint64_t bytes, std::uint64_t least,
                            Leaving leaving) {
  struct Idle {
    std::chrono::steady_clock::time_point last_use;
    const ReloadableMap* map;
  };
  const std::vector<MapHandle> maps = state.store.List();
  std::uint64_t held = 0;
  std::vector<Idle> idle;
  for (const MapHandle& map : maps) {
    held += map->merged->idle_bytes();
    const ReloadableMap* const reloadable = map->reloadable;
    if (reloadable == nullptr || (leaving == Leaving::kAtOnce && !reloadable->leaves_at_once())) {
      continue;
    }
    held += reloadable->idle_bytes();
    idle.push_back({reloadable->last_use(), reloadable});
  }
  if (held < least) return 0;  // whoever needs them would come for nothing
  std::uint64_t freed = 0;
  for (const MapHandle& map : maps) freed += map->merged->Drop();
  std::ranges::sort(idle, {}, &Idle::last_use);
  for (const Idle& entry : idle) {
    if (freed >= bytes) break;
    if (const auto tree = entry.map->Evict()) freed += tree->gatherer->report().device_bytes;
  }
  return freed;
}

Space HostSpace(const State& state) {
  if (!state.maps_in_host_memory()) return {.all_bytes = 0};
  return {.all_bytes = state.memory.room_bytes(),
          .free_bytes = [&memory = state.memory] { return memory.free_bytes(); }};
}

Space DeviceSpace(const State& state, const DeviceInfo& device, const BuildPlan& plan) {
  if (!CheckDeviceRoom(plan, device, 0, plan.name, {}).ok()) return {.all_bytes = 0};
  const auto free_bytes = [&state, &device] {
    const std::uint64_t used = DeviceBytes(state.store.List());
    return device.memory_bytes - std::min(device.memory_bytes, used);
  };
  return {.free_bytes = free_bytes, .needed_bytes = DeviceBytes(plan)};
}

absl::StatusOr<MemoryBudget::Share> TakeForCall(State& state, Holder holder, std::uint64_t bytes,
                                                std::string_view what) {
  if (bytes == 0) return MemoryBudget::Share();
  const auto take = [&] {
    return state.memory.Take(holder, bytes, what, state.device_queue.RetryDelay());
  };
  return WithEviction(state, bytes, HostSpace(state), take, Leaving::kAtOnce);
}

namespace {

/// Builds the tree of `plan` from what `keeper` has, with room taken for it, on the device's
/// thread. The errors of PhotonKeeper::Read and Builder::Build; RESOURCE_EXHAUSTED: there is no
/// room.
absl::StatusOr<std::shared_ptr<const ResidentTree>> LoadTree(State& state, const BuildPlan& plan,
                                                             PhotonKeeper& keeper,
                                                             const CancelCheck& cancelled) {
  const std::string what =
      fmt::format("map '{}' with {} photons is not on the device", plan.name, plan.photon_count);
  const std::uint64_t map_bytes = MapBytes(plan);
  if (!state.options.devices.empty()) {
    const DeviceInfo& device = state.options.devices[state.options.device_index];
    const auto room = WithEviction(state, map_bytes, DeviceSpace(state, device, plan), [&] {
      return CheckDeviceRoom(plan, device, DeviceBytes(state.store.List()), what,
                             state.device_queue.RetryDelay());
    });
    if (!room.ok()) return room;
  }
  const std::uint64_t held_bytes = state.maps_in_host_memory() ? map_bytes : 0;
  const std::uint64_t all_bytes =
      PhotonBytes(plan) + state.builder->WorkBytes(plan.options, plan.photon_count) + held_bytes;
  auto memory = WithEviction(state, all_bytes, HostSpace(state), [&] {
    return state.memory.Take(Holder::kUploads, all_bytes, what, state.device_queue.RetryDelay());
  });
  if (!memory.ok()) return memory.status();
  MemoryBudget::Share held = memory->Split(Holder::kMaps, held_bytes);
  const auto photons = keeper.Read();
  if (!photons.ok()) return photons.status();
  BuildOptions options = plan.options;
  if (Broken("same_tree")) options.max_leaf_size += 1;
  auto gatherer = WithEviction(state, map_bytes, Space{},
                               [&] { return state.builder->Build(*photons, options, cancelled); });
  if (!gatherer.ok()) return gatherer.status();
  if (state.maps_in_host_memory()) held.Resize((*gatherer)->report().device_bytes);
  return std::make_shared<const ResidentTree>(
      ResidentTree{.gatherer = *std::move(gatherer), .memory = std::move(held)});
}

BuildPlan PlanOf(const StoredMap& map, const ReloadableMap::Description& description) {
  return {.name = map.name,
          .photon_count = description.photon_count,
          .has_powers = description.has_powers,
          .has_directions = description.has_directions,
          .options = map.options,
          .time_to_live = {},
          .request_id = {}};
}

}  // namespace

void MakeReloadable(State& state, StoredMap& map, ReloadableMap::Description description,
                    std::shared_ptr<PhotonKeeper> keeper,
                    std::shared_ptr<const ResidentTree> tree) {
  auto load = [&state, plan = PlanOf(map, description), keeper](const CancelCheck& cancelled) {
    return LoadTree(state, plan, *keeper, cancelled);
  };
  auto reloadable = std::make_unique<ReloadableMap>(std::move(description), std::move(load),
                                                    std::move(keeper), std::move(tree));
  map.reloadable = reloadable.get();
  map.gatherer = std::move(reloadable);
}

void MakeReloadable(State& state, StoredMap& map, std::shared_ptr<PhotonKeeper> keeper) {
  ReloadableMap::Description description{.photon_count = map.gatherer->photon_count(),
                                         .has_powers = map.gatherer->has_powers(),
                                         .has_directions = map.gatherer->has_directions(),
                                         .report = map.gatherer->report()};
  auto tree = std::make_shared<const ResidentTree>(
      ResidentTree{.gatherer = std::move(map.gatherer), .memory = std::move(map.memory)});
  MakeReloadable(state, map, std::move(description), std::move(keeper), std::move(tree));
}

}  // namespace treelight::server
