#ifndef TREELIGHT_CLIENT_BENCH_MEAN_RADIUS_H_
#define TREELIGHT_CLIENT_BENCH_MEAN_RADIUS_H_

#include <cstdint>
#include <span>

#include "absl/status/statusor.h"
#include "core/gatherer.h"

namespace treelight {

/// r1 of the workloads: the radius within which 75 photons lie on average over the queries.
struct MeanRadius {
  float radius = 0;          ///< scene units
  std::uint32_t median = 0;  ///< of how many lie within it
};

/// Finds it by halving an interval, from the first 20 000 of `queries` [3m], m > 0, in the unit
/// cube. The errors of Gatherer::Gather.
absl::StatusOr<MeanRadius> FindMeanRadius(const Gatherer& map, std::span<const float> queries);

}  // namespace treelight

#endif  // TREELIGHT_CLIENT_BENCH_MEAN_RADIUS_H_
