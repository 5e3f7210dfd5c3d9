#include "server/warm_up.h"

#include <algorithm>
#include <span>
#include <vector>

#include "core/gatherer.h"

namespace treelight::server {
namespace {

/// Photons on a line and many at one place, so that ties are rebuilt too.
Photons MakePhotons(std::size_t count) {
  Photons photons;
  for (std::size_t i = 0; i < count; ++i) {
    const float x = i % 2 == 0 ? 0.0f : 1000.0f + static_cast<float>(i);
    photons.positions.insert(photons.positions.end(), {x, 0, 0});
    photons.powers.insert(photons.powers.end(), {1, 1, 1});
    photons.directions.insert(photons.directions.end(), {0, 0});
  }
  return photons;
}

absl::Status WarmUpGathers(const Gatherer& map, const Photons& photons) {
  const std::size_t query_count =
      std::min<std::size_t>(photons.size(), 5'000);  // are sorted from 4096 on
  const std::vector<float> positions(photons.positions.begin(),
                                     photons.positions.begin() + 3 * query_count);
  const std::vector<float> normals(positions.size(), 1.0f);
  for (const GatherOptions& options :
       {GatherOptions{.k = 2, .radius = 0.5f, .outputs = kOutputDensity},
        GatherOptions{.k = 0, .radius = 0, .outputs = kOutputCount}}) {
    const auto answer = map.Gather({positions, normals}, options);
    if (!answer.ok()) return answer.status();
  }
  // One query for the kernels of large k and of lists.
  const std::span<const float> far{positions.data() + 3, 3};
  for (const GatherOptions& options :
       {GatherOptions{.k = kMaxNeighbors, .radius = 0, .outputs = kOutputCount},
        GatherOptions{.k = 0, .radius = 0, .outputs = kOutputNeighbors}}) {
    const auto answer = map.Gather({far}, options);
    if (!answer.ok()) return answer.status();
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WarmUp(Builder& builder) {
  // PoCL compiles a kernel once for small grids and once for large ones, of 65536 items and up.
  for (const std::size_t count : {std::size_t{1'000}, std::size_t{1'200'000}}) {
    const Photons photons = MakePhotons(count);
    for (const MortonBits bits : {MortonBits::k63, MortonBits::k30}) {
      const auto map = builder.Build(photons, {.morton_bits = bits});
      if (!map.ok()) return map.status();
      if (const auto status = WarmUpGathers(**map, photons); !status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

}  // namespace treelight::server
