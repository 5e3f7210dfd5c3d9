#include "client/remote_map.h"

#include <utility>

namespace treelight::client {
namespace {

BuildReport ReportOf(const v1::PhotonMap& map) {
  const v1::TreeStatistics& tree = map.statistics();
  BuildReport report{.builder = map.builder(),
                     .device = map.device(),
                     .device_bytes = map.device_bytes(),
                     .stages = {},
                     .radius = map.options().radius(),
                     .tree = {.node_count = tree.node_count(),
                              .leaf_count = tree.leaf_count(),
                              .depth = tree.depth(),
                              .mean_leaf_depth = tree.mean_leaf_depth(),
                              .leaf_fill = tree.leaf_fill(),
                              .sah_cost = tree.sah_cost(),
                              .isa_cost = tree.isa_cost()}};
  for (const v1::StageTime& stage : map.build_stages()) {
    report.stages.push_back({stage.stage(), stage.microseconds()});
  }
  return report;
}

}  // namespace

RemoteMap::RemoteMap(PhotonMapClient& client, const v1::PhotonMap& map)
    : client_(client),
      map_{.name = map.name(), .version = map.version()},
      photon_count_(map.photon_count()),
      has_powers_(map.has_powers()),
      has_directions_(map.has_directions()),
      report_(ReportOf(map)) {}

absl::StatusOr<GatherResult> RemoteMap::Gather(const GatherQueries& queries,
                                               const GatherOptions& options,
                                               const CancelCheck& cancelled) const {
  if (cancelled && cancelled()) return absl::CancelledError("gather cancelled");
  auto answer = client_.Gather(map_, queries, options);
  if (!answer.ok()) return answer.status();
  return std::move(answer->result);
}

absl::StatusOr<Tree> RemoteMap::ReadTree() const {
  return absl::UnimplementedError("trees do not leave the server");
}

absl::StatusOr<Photons> RemoteMap::ReadPhotons() const {
  return absl::UnimplementedError("photons do not leave the server");
}

}  // namespace treelight::client
