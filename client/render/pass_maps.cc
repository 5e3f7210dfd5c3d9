#include "client/render/pass_maps.h"

#include <algorithm>

#include "client/render/gather_radius.h"
#include "client/render/stopwatch.h"

namespace treelight::client {
namespace {

absl::StatusOr<std::optional<float>> ChooseRadius(PhotonMapClient& client,
                                                  const std::optional<MapRef>& map,
                                                  const Photons& photons,
                                                  const FirstRadius& first) {
  if (!map) return std::nullopt;
  if (first.given) return first.given;
  const auto k = static_cast<std::uint32_t>(std::min<std::size_t>(first.k, photons.size()));
  const auto chosen = RadiusOfNearest(client, *map, photons, k, first.quantile);
  if (!chosen.ok()) return chosen.status();
  return *chosen;
}

}  // namespace

absl::StatusOr<PassMaps> MakePassMaps(const Intersector& intersector, PhotonMapClient& client,
                                      const PassMapOptions& options) {
  const Stopwatch begin;
  const auto photons = TracePhotons(intersector, {.indirect_photons = options.indirect_photons,
                                                  .caustic_photons = options.caustic_photons,
                                                  .seed = options.seed,
                                                  .cancelled = options.cancelled,
                                                  .emitters = options.emitters});
  if (!photons.ok()) return photons.status();
  const auto uploaded = UploadMaps(client, *photons, options.upload);
  if (!uploaded.ok()) return uploaded.status();
  PassMaps maps{.maps = uploaded->refs(),
                .photons = photons->indirect.size() + photons->caustic.size(),
                .indirect_radius = {},
                .caustic_radius = {}};
  const auto indirect =
      ChooseRadius(client, maps.maps.indirect, photons->indirect, options.indirect);
  const auto caustic = ChooseRadius(client, maps.maps.caustic, photons->caustic, options.caustic);
  if (!indirect.ok() || !caustic.ok()) {
    DeleteMaps(client, maps.maps).IgnoreError();  // the first error tells more
    return indirect.ok() ? caustic.status() : indirect.status();
  }
  maps.indirect_radius = *indirect;
  maps.caustic_radius = *caustic;
  maps.seconds = begin.Seconds();
  return maps;
}

}  // namespace treelight::client
