#include "core/cpu/answers.h"

#include <cmath>

#include "core/cpu/density.h"

namespace treelight {

absl::StatusOr<GatherResult> WriteAnswers(const Photons& photons, const GatherQueries& queries,
                                          const GatherOptions& options,
                                          const std::vector<QueryAnswer>& answers) {
  const std::size_t m = answers.size();
  const auto wants = [&](std::uint32_t output) { return (options.outputs & output) != 0; };
  GatherResult result;
  if (wants(kOutputNeighbors) && options.k == 0) {
    std::uint64_t neighbor_count = 0;
    for (const QueryAnswer& answer : answers) neighbor_count += answer.found.size();
    if (const auto status = CheckNeighborCount(neighbor_count, options); !status.ok()) {
      return status;
    }
    result.neighbor_offsets.push_back(0);
  }
  if (wants(kOutputDensity)) result.densities.assign(3 * m, 0);
  for (std::size_t i = 0; i < m; ++i) {
    const std::vector<Candidate>& found = answers[i].found;
    const float radius = options.k > 0 && found.size() == options.k
                             ? std::sqrt(found.back().squared_distance)
                             : answers[i].limit;
    float error_bound = answers[i].error_bound;
    if (wants(kOutputCount)) result.counts.push_back(static_cast<std::uint32_t>(found.size()));
    if (wants(kOutputRadius)) result.radii.push_back(radius);
    if (wants(kOutputNeighbors)) {
      for (const auto& [d2, id] : found) {
        result.neighbor_ids.push_back(id);
        result.neighbor_squared_distances.push_back(d2);
      }
      if (options.k == 0) {
        result.neighbor_offsets.push_back(result.neighbor_ids.size());
      } else {
        result.neighbor_ids.resize((i + 1) * options.k, kNoPhoton);
        result.neighbor_squared_distances.resize((i + 1) * options.k, INFINITY);
      }
    }
    if (wants(kOutputDensity) && !photons.powers.empty()) {
      DensitySum sum(photons, queries.normals.empty() ? nullptr : &queries.normals[3 * i],
                     options.kernel, radius);
      const auto& summed = answers[i].summed;
      for (const auto& [d2, id] : summed ? summed->apart : found) sum.Add(d2, id);
      if (summed) {
        sum.AddWhole(summed->sums);
        error_bound = sum.PerArea(summed->error);
      }
      sum.Write(&result.densities[3 * i]);
    }
    if (wants(kOutputStatistics)) {
      result.nodes_visited.push_back(answers[i].nodes_visited);
      result.distance_tests.push_back(answers[i].distance_tests);
    }
    if (options.approximation.any()) result.error_bounds.push_back(error_bound);
  }
  return result;
}

}  // namespace treelight
