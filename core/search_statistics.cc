#include "core/search_statistics.h"

#include <numeric>

namespace treelight {
namespace {

double Mean(const std::vector<std::uint32_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), 0.0) / static_cast<double>(counts.size());
}

}  // namespace

absl::StatusOr<SearchStatistics> MeasureSearches(const Gatherer& map,
                                                 std::span<const float> queries) {
  SearchStatistics statistics;
  if (queries.empty()) return statistics;
  const auto exact =
      map.Gather({.positions = queries}, {.k = 1, .radius = 0, .outputs = kOutputStatistics});
  if (!exact.ok()) return exact.status();
  statistics.exact_nodes = Mean(exact->nodes_visited);

  const auto nearest =
      map.Gather({.positions = queries}, {.k = 50, .outputs = kOutputStatistics | kOutputRadius});
  if (!nearest.ok()) return nearest.status();
  statistics.knn50_nodes = Mean(nearest->nodes_visited);
  statistics.knn50_tests = Mean(nearest->distance_tests);

  // With a k that is never reached, since a gather without one counts whole subtrees unvisited.
  const auto within = map.Gather({.positions = queries, .radii = nearest->radii},
                                 {.k = kMaxNeighbors, .outputs = kOutputStatistics});
  if (!within.ok()) return within.status();
  statistics.r50_nodes = Mean(within->nodes_visited);
  statistics.r50_tests = Mean(within->distance_tests);
  return statistics;
}

}  // namespace treelight
