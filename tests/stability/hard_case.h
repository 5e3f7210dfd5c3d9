#ifndef TREELIGHT_TESTS_STABILITY_HARD_CASE_H_
#define TREELIGHT_TESTS_STABILITY_HARD_CASE_H_

#include <cstdint>
#include <string>
#include <vector>

#include "core/builder.h"
#include "gtest/gtest.h"
#include "tests/clouds.h"

namespace treelight {

/// A builder at one precision: the kinds of tree_kinds.h, one for each builder and heuristic, those
/// that read Morton codes with 30 and with 63 bits; leaves of 8.
struct StabilityTree {
  std::string name;
  BuildOptions options;
};
const std::vector<StabilityTree>& StabilityTrees();

/// A search that plain implementations fail at.
struct HardSearch {
  std::string name;
  GatherOptions options;
};

/// One set of photons, what is asked of it, and the right answers.
class HardCase {
 public:
  /// Compares every query with every photon, by TBB in the arena of the caller.
  HardCase(const CloudShape& shape, std::size_t photon_count, std::size_t query_count,
           std::uint32_t seed);

  const std::string& name() const { return name_; }
  const Photons& photons() const { return photons_; }
  const std::vector<float>& queries() const { return queries_; }  ///< [3m]
  /// k of 1, 8, 50 and, where a gather takes as many, more than there are photons; with a radius
  /// and without; all within a radius, listed, counted and added up; radii of 0 and of squares
  /// that underflow and overflow.
  const std::vector<HardSearch>& searches() const { return searches_; }

  /// Whether `map` answers every search as brute force in float32 does: counts, radii, neighbours
  /// and squared distances bit by bit, densities but for 1e-6 of their addends.
  testing::AssertionResult AnswersAsBruteForce(const Gatherer& map) const;

  /// Queries whose k-th and next photon are equally far, of the search for the 8 nearest.
  std::size_t TiesAtRankK() const;

 private:
  GatherQueries QueriesOf(const HardSearch& search) const;

  std::string name_;
  Photons photons_;
  std::vector<float> queries_;
  std::vector<HardSearch> searches_;
  std::vector<GatherResult> answers_;  // of each search
};

/// Inner nodes and photons that one search for the 50 nearest examines, a mean over photons as
/// queries: what the set does to a tree, independently of the machine.
double WorkOfSearches(const Gatherer& map, const Photons& photons);

/// Whether two answers are the same bits, densities too.
bool SameBits(const GatherResult& a, const GatherResult& b);

}  // namespace treelight

#endif  // TREELIGHT_TESTS_STABILITY_HARD_CASE_H_
