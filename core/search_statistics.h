#ifndef TREELIGHT_CORE_SEARCH_STATISTICS_H_
#define TREELIGHT_CORE_SEARCH_STATISTICS_H_

#include <span>

#include "core/gatherer.h"

namespace treelight {

/// What searches cost in a map, means over queries: nodes visited and distance tests. They judge a
/// tree independently of the machine.
struct SearchStatistics {
  double exact_nodes = 0;  ///< the photon at the query's position: k 1, radius 0, as Bulavintsev
                           ///< and Zhdanov 2020 search
  double knn50_nodes = 0, knn50_tests = 0;  ///< the 50 nearest
  double r50_nodes = 0, r50_tests = 0;      ///< all within the distance of the 50th nearest

  friend bool operator==(const SearchStatistics&, const SearchStatistics&) = default;
};

/// Measures by three gathers of `map`. Zeros where there are no queries.
/// @param queries  [3m] scene units; for `exact_nodes` to mean something, positions of photons
absl::StatusOr<SearchStatistics> MeasureSearches(const Gatherer& map,
                                                 std::span<const float> queries);

}  // namespace treelight

#endif  // TREELIGHT_CORE_SEARCH_STATISTICS_H_
