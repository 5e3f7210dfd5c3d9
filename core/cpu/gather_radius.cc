#include "core/cpu/gather_radius.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/cpu/traverse.h"

namespace treelight {
namespace {

std::uint32_t Hash(std::uint32_t input) {
  const std::uint32_t state = input * 747796405u + 2891336453u;
  const std::uint32_t word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
  return (word >> 22) ^ word;
}

}  // namespace

std::vector<std::uint32_t> SamplePhotons(std::uint32_t photon_count, std::uint32_t seed) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = 0; i < kRadiusSamples; ++i)
    ids.push_back(Hash(Hash(seed) + i) % photon_count);
  return ids;
}

float MedianRadius(std::vector<float> radii) {
  std::erase(radii, 0.0f);
  if (radii.empty()) return 0;
  const auto median = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), median, radii.end());
  return *median;
}

float SampleGatherRadius(const Tree& tree, const std::vector<float>& positions,
                         std::uint32_t seed) {
  if (tree.root.count == 0) return 0;
  const std::uint32_t k = std::min(kRadiusNeighbors, tree.root.count);
  std::vector<float> radii;
  for (const std::uint32_t id : SamplePhotons(tree.root.count, seed)) {
    const float* p = &positions[3 * std::size_t{id}];
    const QueryAnswer answer =
        FindNearest(tree, {p[0], p[1], p[2]}, k, std::numeric_limits<float>::infinity());
    radii.push_back(std::sqrt(answer.found.back().squared_distance));
  }
  return MedianRadius(std::move(radii));
}

}  // namespace treelight
