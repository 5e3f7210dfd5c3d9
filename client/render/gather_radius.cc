#include "client/render/gather_radius.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

namespace treelight::client {
namespace {

/// Where the photons lie on one point; no estimate is finer, scene units.
constexpr float kMinRadius = 1e-6f;

/// Positions of `count` of the photons, evenly over their order, which is that of their paths.
std::vector<float> SamplePositions(const Photons& photons, std::size_t count) {
  std::vector<float> positions;
  positions.reserve(3 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 position = photons.position(i * photons.size() / count);
    positions.insert(positions.end(), {position.x, position.y, position.z});
  }
  return positions;
}

}  // namespace

absl::StatusOr<float> RadiusOfNearest(PhotonMapClient& client, const MapRef& map,
                                      const Photons& photons, std::uint32_t k, double quantile) {
  assert(k > 0 && k <= photons.size() && quantile > 0 && quantile <= 1);
  const std::size_t count = std::min(photons.size(), kRadiusSample);
  const std::vector<float> positions = SamplePositions(photons, count);
  auto answer = client.Gather(
      map, {.positions = positions, .normals = {}, .radii = {}},
      {.k = k, .radius = std::numeric_limits<float>::infinity(), .outputs = kOutputRadius});
  if (!answer.ok()) return answer.status();
  std::vector<float>& radii = answer->result.radii;
  const auto rank = static_cast<std::size_t>(std::ceil(quantile * static_cast<double>(count))) - 1;
  std::ranges::nth_element(radii, radii.begin() + static_cast<std::ptrdiff_t>(rank));
  return std::max(radii[rank], kMinRadius);
}

}  // namespace treelight::client
