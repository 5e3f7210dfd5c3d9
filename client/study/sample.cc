#include "client/study/sample.h"

#include <random>

namespace treelight::client {

std::vector<float> SamplePositions(std::span<const float> positions, std::uint32_t count,
                                   std::uint64_t seed) {
  std::vector<float> chosen;
  if (positions.empty()) return chosen;
  std::mt19937_64 random(seed);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::size_t first = 3 * (random() % (positions.size() / 3));
    chosen.insert(chosen.end(), {positions[first], positions[first + 1], positions[first + 2]});
  }
  return chosen;
}

}  // namespace treelight::client
