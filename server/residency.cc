#include "server/residency.h"

#include <string>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/room.h"
#include "server/upload.h"

namespace treelight::server {
namespace {

/// Builds the tree of `plan` from what `keeper` has, with room taken for it, on the device's
/// thread. The errors of PhotonKeeper::Read and Builder::Build; RESOURCE_EXHAUSTED: there is no
/// room.
absl::StatusOr<std::shared_ptr<const ResidentTree>> LoadTree(State& state, const BuildPlan& plan,
                                                             PhotonKeeper& keeper,
                                                             const CancelCheck& cancelled) {
  const std::string what =
      fmt::format("map '{}' with {} photons is not on the device", plan.name, plan.photon_count);
  if (auto status = MakeDeviceRoom(state, plan, what); !status.ok()) return status;
  const std::uint64_t held_bytes = state.maps_in_host_memory() ? MapBytes(plan) : 0;
  const std::uint64_t all_bytes =
      PhotonBytes(plan) + state.builder->WorkBytes(plan.options, plan.photon_count) + held_bytes;
  auto memory = TakeHostMemory(state, Holder::kUploads, all_bytes, what);
  if (!memory.ok()) return memory.status();
  MemoryBudget::Share held = memory->Split(Holder::kMaps, held_bytes);
  const auto photons = keeper.Read();
  if (!photons.ok()) return photons.status();
  BuildOptions options = plan.options;
  if (Broken("same_tree")) options.max_leaf_size += 1;
  auto gatherer = BuildWithRoom(state, *photons, plan, options, cancelled);
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
