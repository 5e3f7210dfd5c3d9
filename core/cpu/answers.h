#ifndef TREELIGHT_CORE_CPU_ANSWERS_H_
#define TREELIGHT_CORE_CPU_ANSWERS_H_

#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/gatherer.h"

namespace treelight {

/// A photon within the radius of a query.
struct Candidate {
  float squared_distance;
  std::uint32_t id;
  friend auto operator<=>(const Candidate&,
                          const Candidate&) = default;  // NOLINT(modernize-use-nullptr)
};

/// How a density adds up photons that are not looked at one by one.
struct SummedPhotons {
  std::array<double, 3> sums{};  ///< weight * power of whole subtrees
  double error = 0;              ///< of each channel of them
  std::vector<Candidate> apart;  ///< the photons beside them
};

/// What the search for one query found.
struct QueryAnswer {
  float limit = 0;               ///< r of the query
  std::vector<Candidate> found;  ///< ascending
  std::uint32_t nodes_visited = 0;
  std::uint32_t distance_tests = 0;
  float error_bound = 0;                  ///< as GatherResult::error_bounds, where k > 0
  std::optional<SummedPhotons> summed{};  ///< of what was found, for a density
};

/// Makes of the answers what GatherOptions asks for. RESOURCE_EXHAUSTED as CheckNeighborCount.
absl::StatusOr<GatherResult> WriteAnswers(const Photons& photons, const GatherQueries& queries,
                                          const GatherOptions& options,
                                          const std::vector<QueryAnswer>& answers);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_ANSWERS_H_
