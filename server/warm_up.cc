#include "server/warm_up.h"

#include <array>
#include <cstdint>
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

}  // namespace

absl::Status WarmUp(Builder& builder) {
  // As many photons and queries as have the kernels launched the way that a large map has them.
  const Photons photons = MakePhotons(100'000);
  const std::vector<float> positions(photons.positions.begin(),
                                     photons.positions.begin() + 3 * 5'000);
  const std::vector<float> normals(positions.size(), 1.0f);
  constexpr std::array kGathers = {
      GatherOptions{.k = 2, .outputs = kOutputDensity},
      GatherOptions{.k = kMaxNeighbors, .radius = 0.5f, .outputs = kOutputCount},
      GatherOptions{.k = 0, .radius = 0.5f, .outputs = kOutputDensity},
      GatherOptions{.k = 0, .radius = 1.0f, .outputs = kOutputCount},
  };
  for (const MortonBits bits : {MortonBits::k63, MortonBits::k30}) {
    const auto map = builder.Build(photons, {.morton_bits = bits});
    if (!map.ok()) return map.status();
    if (bits != MortonBits::k30) continue;
    for (const GatherOptions& options : kGathers) {
      const auto answer = (*map)->Gather({positions, normals}, options);
      if (!answer.ok()) return answer.status();
    }
    const auto lists = (*map)->Gather({{positions.data() + 3, 3}},
                                      {.k = 0, .radius = 1, .outputs = kOutputNeighbors});
    if (!lists.ok()) return lists.status();
  }
  return absl::OkStatus();
}

}  // namespace treelight::server
