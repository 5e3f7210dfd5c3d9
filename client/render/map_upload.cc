#include "client/render/map_upload.h"

#include "client/render/stopwatch.h"

namespace treelight::client {
namespace {

std::optional<MapRef> Ref(const std::optional<v1::BuildPhotonMapResponse>& built) {
  if (!built) return std::nullopt;
  return MapRef{.name = built->map().name(), .version = built->map().version()};
}

}  // namespace

PhotonMaps UploadedMaps::refs() const {
  return {.indirect = Ref(indirect), .caustic = Ref(caustic)};
}

absl::StatusOr<UploadedMaps> UploadMaps(PhotonMapClient& client, const TracedPhotons& photons,
                                        const MapUploadOptions& options) {
  const Stopwatch begin;
  UploadedMaps maps;
  std::uint64_t sent_before = 0;
  const auto build = [&](const Photons& set, const char* ending,
                         std::optional<v1::BuildPhotonMapResponse>& built) -> absl::Status {
    if (set.size() == 0) return absl::OkStatus();
    UploadOptions upload{.time_to_live = options.time_to_live};
    if (options.progress) {
      upload.progress = [&](std::uint64_t sent) { options.progress(sent_before + sent); };
    }
    auto response = client.BuildPhotonMap(options.name + ending, set, upload);
    if (!response.ok()) return response.status();
    built = *std::move(response);
    sent_before += set.size();
    return absl::OkStatus();
  };
  auto status = build(photons.indirect, ".indirect", maps.indirect);
  if (status.ok()) status = build(photons.caustic, ".caustic", maps.caustic);
  if (!status.ok()) {
    DeleteMaps(client, maps.refs()).IgnoreError();  // the first error tells more
    return status;
  }
  maps.seconds = begin.Seconds();
  return maps;
}

absl::Status DeleteMaps(PhotonMapClient& client, const PhotonMaps& maps) {
  absl::Status status;
  for (const auto& map : {maps.indirect, maps.caustic}) {
    if (map) status.Update(client.DeletePhotonMap(*map).status());
  }
  return status;
}

}  // namespace treelight::client
