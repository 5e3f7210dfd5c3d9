#include "client/bench/mean_radius.h"

#include <algorithm>
#include <numeric>

namespace treelight {

absl::StatusOr<MeanRadius> FindMeanRadius(const Gatherer& map, std::span<const float> queries) {
  constexpr std::size_t kQueries = 20'000;
  constexpr double kPhotons = 75;
  constexpr int kHalvings = 40;
  const auto some = queries.first(std::min(queries.size(), 3 * kQueries));
  float low = 0, high = 2;
  std::vector<std::uint32_t> counts;
  for (int i = 0; i < kHalvings; ++i) {
    const float radius = (low + high) / 2;
    auto found =
        map.Gather({.positions = some}, {.k = 0, .radius = radius, .outputs = kOutputCount});
    if (!found.ok()) return found.status();
    counts = std::move(found->counts);
    const double sum = std::accumulate(counts.begin(), counts.end(), 0.0);
    (sum / static_cast<double>(counts.size()) < kPhotons ? low : high) = radius;
  }
  const auto median = counts.begin() + static_cast<std::ptrdiff_t>(counts.size() / 2);
  std::nth_element(counts.begin(), median, counts.end());
  return MeanRadius{low, *median};
}

}  // namespace treelight
