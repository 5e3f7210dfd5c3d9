#include "client/bench/remote_builder.h"

#include <memory>
#include <random>
#include <utility>

#include "client/build_names.h"
#include "client/remote_map.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::chrono::hours kTimeToLive{1};

/// Deletes the map when it goes.
class OwnedMap : public RemoteMap {
 public:
  OwnedMap(PhotonMapClient& client, const v1::PhotonMap& map)
      : RemoteMap(client, map),
        client_(client),
        map_{.name = map.name(), .version = map.version()} {}
  ~OwnedMap() override { (void)client_.DeletePhotonMap(map_); }

 private:
  PhotonMapClient& client_;
  const MapRef map_;
};

v1::BuildOptions ToWire(const BuildOptions& options) {
  v1::BuildOptions wire;
  SetBuilder(BuilderName(options), wire);
  wire.set_max_leaf_size(options.max_leaf_size);
  return wire;
}

}  // namespace

RemoteBuilder::RemoteBuilder(PhotonMapClient& client)
    : client_(client), name_(fmt::format("bench-{:08x}", std::random_device{}())) {}

absl::StatusOr<std::unique_ptr<Gatherer>> RemoteBuilder::Build(const Photons& photons,
                                                               const BuildOptions& options,
                                                               const CancelCheck& cancelled) {
  if (cancelled && cancelled()) return absl::CancelledError("build cancelled");
  const auto built = client_.BuildPhotonMap(
      name_, photons, {.build = ToWire(options), .time_to_live = kTimeToLive});
  if (!built.ok()) return built.status();
  return std::make_unique<OwnedMap>(client_, built->map());
}

}  // namespace treelight::client
