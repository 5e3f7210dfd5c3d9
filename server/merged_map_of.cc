#include "server/merged_map_of.h"

#include <string>
#include <utility>

#include "core/model/merge_photons.h"
#include "core/model/thin_photons.h"
#include "fmt/format.h"
#include "server/room.h"
#include "server/upload.h"

namespace treelight::server {
namespace {

/// Of `photon_count` photons as `map` has them.
BuildPlan PlanOf(const StoredMap& map, std::uint64_t photon_count) {
  return {.name = map.name,
          .photon_count = photon_count,
          .has_powers = map.gatherer->has_powers(),
          .has_directions = map.gatherer->has_directions(),
          .options = map.options,
          .time_to_live = {},
          .request_id = {}};
}

/// Fewer photons of `map`; the copies that they are made of are paid for meanwhile.
absl::StatusOr<Photons> Reduce(State& state, const StoredMap& map, const FewerPhotons& fewer,
                               const std::string& what) {
  const bool merges = fewer.kind == FewerPhotons::Kind::kMerged;
  const BuildPlan whole = PlanOf(map, map.gatherer->photon_count());
  const auto memory = TakeHostMemory(state, Holder::kUploads,
                                     (merges ? MapBytes(whole) : 0) + 2 * PhotonBytes(whole), what);
  if (!memory.ok()) return memory.status();
  const auto photons = map.gatherer->ReadPhotons();
  if (!photons.ok()) return photons.status();
  if (!merges) return ThinPhotons(*photons, fewer.group_size);
  const auto tree = map.gatherer->ReadTree();
  if (!tree.ok()) return tree.status();
  return MergePhotons(*tree, *photons, fewer.group_size);
}

absl::StatusOr<ResidentFewer> Make(State& state, const StoredMap& map, const FewerPhotons& fewer,
                                   const CancelCheck& cancelled) {
  const std::string what =
      fewer.kind == FewerPhotons::Kind::kMerged
          ? fmt::format("map '{}' with up to {} photons merged to one", map.name, fewer.group_size)
          : fmt::format("map '{}' with one of {} photons", map.name, fewer.group_size);
  const auto photons = Reduce(state, map, fewer, what);
  if (!photons.ok()) return photons.status();
  if (cancelled && cancelled()) return absl::CancelledError("gather cancelled");
  const BuildPlan plan = PlanOf(map, photons->size());
  if (auto status = MakeDeviceRoom(state, plan, what); !status.ok()) return status;
  // The photons, what building takes, and the map.
  const std::uint64_t held_bytes = state.maps_in_host_memory() ? MapBytes(plan) : 0;
  const std::uint64_t work_bytes =
      PhotonBytes(plan) + state.builder->WorkBytes(plan.options, plan.photon_count);
  auto memory = TakeHostMemory(state, Holder::kUploads, work_bytes + held_bytes, what);
  if (!memory.ok()) return memory.status();
  MemoryBudget::Share held = memory->Split(Holder::kMaps, held_bytes);
  auto gatherer = BuildWithRoom(state, *photons, plan, plan.options, cancelled);
  if (!gatherer.ok()) return gatherer.status();
  if (state.maps_in_host_memory()) held.Resize((*gatherer)->report().device_bytes);
  return ResidentFewer{.tree = std::make_shared<const ResidentTree>(ResidentTree{
                           .gatherer = *std::move(gatherer), .memory = std::move(held)}),
                       .photon_power = MeanPower(*photons)};
}

}  // namespace

absl::StatusOr<MapOfFewer> MergedMapOf(State& state, const StoredMap& map,
                                       const FewerPhotons& fewer, const CancelCheck& cancelled) {
  ResidentFewer merged = map.merged->Find(fewer);
  if (merged.tree == nullptr) {
    std::shared_ptr<const ResidentTree> tree;  // stays while others leave the device
    if (map.reloadable != nullptr) {
      auto acquired = map.reloadable->Acquire(cancelled);
      if (!acquired.ok()) return acquired.status();
      tree = *std::move(acquired);
    }
    auto made = Make(state, map, fewer, cancelled);
    if (!made.ok()) return made.status();
    merged = *std::move(made);
    map.merged->Keep(fewer, merged);
  }
  const Gatherer* const gatherer = merged.tree->gatherer.get();
  return MapOfFewer{.map = {std::move(merged.tree), gatherer}, .photon_power = merged.photon_power};
}

}  // namespace treelight::server
