#include "server/persistence.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/convert.h"
#include "server/residency.h"
#include "server/tell.h"

namespace treelight::server {
namespace {

void Tell(const SnapshotFolder& folder, std::string_view what) {
  server::Tell(fmt::format("data folder '{}': {}", folder.path(), what));
}

/// Renames the damaged `file`, and tells.
void SetAside(const SnapshotFolder& folder, const std::string& file, const absl::Status& damage) {
  const auto aside = folder.SetAside(file);
  Tell(folder, fmt::format("'{}' is damaged: {}; {}", file, std::string(damage.message()),
                           aside.ok() ? fmt::format("set aside as '{}'", *aside)
                                      : std::string(aside.status().message())));
}

/// Reads the photons of a version; one whose file is damaged or gone leaves the store.
absl::StatusOr<Photons> ReadKept(State& state, const std::string& name, std::uint64_t version,
                                 std::uint64_t checksum) {
  auto photons = state.snapshots->Read(name, version, checksum);
  const bool lost = absl::IsDataLoss(photons.status()), gone = absl::IsNotFound(photons.status());
  const std::string file = SnapshotName(name, version);
  if (lost) SetAside(*state.snapshots, file, photons.status());
  if (lost || gone) {
    // The handle that the caller has keeps the map until the call is over.
    const auto map = state.store.Find(name, version);
    if (map.ok() && (*map)->checksum == checksum) state.store.Drop({*map});
  }
  if (photons.ok() || absl::IsResourceExhausted(photons.status())) return photons;
  return absl::Status(
      photons.status().code(),
      fmt::format("'{}' of the data folder: {}", file, std::string(photons.status().message())));
}

/// Photons that are in the file of their map.
class FilePhotons final : public PhotonKeeper {
 public:
  FilePhotons(State& state, const StoredMap& map)
      : state_(state), name_(map.name), version_(map.version), checksum_(map.checksum) {}

  bool has_photons() const override { return true; }
  absl::Status Save(const Gatherer&) override { return absl::OkStatus(); }
  void Forget() override {}
  absl::StatusOr<Photons> Read() override { return ReadKept(state_, name_, version_, checksum_); }

 private:
  State& state_;
  const std::string name_;
  const std::uint64_t version_, checksum_;
};

TimePoint FromUnixMs(std::int64_t ms) { return TimePoint(std::chrono::milliseconds(ms)); }

/// The map that `head` tells of, off the device.
StoredMap FromHead(State& state, const SnapshotHead& head) {
  const v1::PhotonMap& wire = head.map;
  StoredMap map{.name = wire.name(),
                .version = wire.version(),
                .request_id = head.request_id,
                .options = head.options,
                .request = head.request,
                .gatherer = nullptr,
                .created = FromUnixMs(wire.created_unix_ms()),
                .expires = {},
                .checksum = head.checksum};
  if (wire.expires_unix_ms() != 0) map.expires = FromUnixMs(wire.expires_unix_ms());
  ReloadableMap::Description description{.photon_count = wire.photon_count(),
                                         .has_powers = wire.has_powers(),
                                         .has_directions = wire.has_directions(),
                                         .report = {}};
  BuildReport& report = description.report;
  report.builder = wire.builder();
  report.device = state.device_name();
  report.radius = wire.options().radius();
  for (const v1::StageTime& stage : wire.build_stages()) {
    report.stages.push_back({stage.stage(), stage.microseconds()});
  }
  const v1::TreeStatistics& tree = wire.statistics();
  report.tree = {.node_count = tree.node_count(),
                 .leaf_count = tree.leaf_count(),
                 .depth = tree.depth(),
                 .mean_leaf_depth = tree.mean_leaf_depth(),
                 .leaf_fill = tree.leaf_fill(),
                 .sah_cost = tree.sah_cost(),
                 .isa_cost = tree.isa_cost()};
  MakeReloadable(state, map, std::move(description), std::make_shared<FilePhotons>(state, map),
                 nullptr);
  return map;
}

}  // namespace

absl::StatusOr<MapHandle> TakeUp(State& state, const SnapshotFolder::File& file) {
  const SnapshotFolder& folder = *state.snapshots;
  if (absl::IsDataLoss(file.head.status())) {
    SetAside(folder, file.name, file.head.status());
    if (Broken("damaged_file")) return absl::InternalError("a file is damaged");
    return nullptr;
  }
  if (!file.head.ok()) {
    Tell(folder, fmt::format("'{}' is not loaded: {}", file.name,
                             std::string(file.head.status().message())));
    return file.head.status();
  }
  auto map = std::make_shared<const StoredMap>(FromHead(state, *file.head));
  if (map->expires && *map->expires <= std::chrono::system_clock::now()) {
    if (auto status = folder.Remove(map->name, map->version, map->checksum); !status.ok()) {
      return status;
    }
    return nullptr;
  }
  state.store.Restore({map});
  return map;
}

absl::Status LoadSnapshots(State& state) {
  const SnapshotFolder& folder = *state.snapshots;
  if (auto status = folder.CheckWritable(); !status.ok()) return status;
  folder.RemoveLeftovers();
  const auto files = folder.CheckAll();
  if (!files.ok()) return files.status();
  state.mirror = std::make_unique<FolderMirror>(state);
  if (auto status = state.mirror->Begin(*files); !status.ok()) return status;
  state.store.OnExpired([&state](const std::vector<MapHandle>& expired) {
    state.disk.Submit([&state, expired] {
      for (const MapHandle& map : expired) {
        const auto status = state.snapshots->Remove(map->name, map->version, map->checksum);
        if (!status.ok()) server::Tell(std::string(status.message()));
      }
    });
  });
  return absl::OkStatus();
}

absl::StatusOr<MapHandle> KeepMap(State& state, StoredMap map, const Photons& photons) {
  v1::PhotonMap wire = ToWire(map);
  MapHandle known;
  std::optional<FolderMirror::Transit> transit;
  // Nobody else has built for this request before the file has its name. Until then a file of that
  // name is another server's, which is shown.
  const auto approve = [&] {
    state.mirror->Update();
    known = state.store.FindRequest(map.request_id);
    if (Broken("shared_request_id")) known = nullptr;
    if (known != nullptr) return absl::AbortedError("it is built already");
    transit.emplace(*state.mirror,
                    [&] { return std::vector{SnapshotName(map.name, map.version)}; });
    return absl::OkStatus();
  };
  while (true) {
    transit.reset();
    // A file that another server, or a later program, has put there keeps its version.
    if (!Broken("shared_version")) state.mirror->Update();
    map.version = state.store.ReserveVersion(map.name);
    wire.set_version(map.version);
    const auto written =
        state.snapshots->Write(wire, map.request_id, map.request, photons, approve);
    if (known != nullptr) {
      if (auto status = CheckRepeat(*known, map.request); !status.ok()) return status;
      return known;
    }
    if (absl::IsAlreadyExists(written.status())) continue;
    if (!written.ok()) return written.status();
    map.checksum = *written;
    MakeReloadable(state, map, std::make_shared<FilePhotons>(state, map));
    return state.store.Add(std::move(map));
  }
}

absl::StatusOr<std::vector<MapHandle>> RemoveMaps(State& state, std::string_view name,
                                                  std::uint64_t version) {
  if (state.snapshots == nullptr) return state.store.Remove(name, version);
  state.mirror->Update();
  absl::StatusOr<std::vector<MapHandle>> removed;
  const FolderMirror::Transit transit(*state.mirror, [&] {
    removed = state.store.Remove(name, version);
    std::vector<std::string> files;
    if (!removed.ok()) return files;
    for (const MapHandle& map : *removed) files.push_back(SnapshotName(map->name, map->version));
    return files;
  });
  if (!removed.ok()) return removed;
  for (const MapHandle& map : *removed) {
    if (auto status = state.snapshots->Remove(map->name, map->version, map->checksum);
        !status.ok()) {
      state.store.Restore(*removed);
      return status;
    }
  }
  return removed;
}

}  // namespace treelight::server
