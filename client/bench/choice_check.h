#ifndef TREELIGHT_CLIENT_BENCH_CHOICE_CHECK_H_
#define TREELIGHT_CLIENT_BENCH_CHOICE_CHECK_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/bench/workloads.h"
#include "core/build_chooser.h"

namespace treelight::client {

/// What the server's choice of trees is compared over.
struct ChoicePlan {
  std::vector<PointSet> sets;
  std::vector<std::uint64_t> photons;
  std::uint64_t queries = 100'000;
  std::uint32_t repetitions = 5;
  std::vector<std::uint32_t> seeds;
};

/// What was chosen for a number of gathers, beside the best of all candidates; milliseconds of the
/// build and these gathers, medians.
struct ChoiceRow {
  std::string set;
  std::uint32_t seed = 0;
  std::uint64_t photons = 0;
  std::uint32_t k = 0;  ///< 0: counts within r1
  double gathers = 0;
  std::string chosen, best;  ///< "lbvh 64": builder and leaf size
  double chosen_ms = 0, best_ms = 0;

  double ratio() const { return chosen_ms / best_ms; }
};

/// Measures every candidate of BuildChooser over each set, turn by turn, and what it chooses for
/// 1e3 to 1e9 gathers of k 8, 50 and 100 and of counts within r1. Answers are judged. INTERNAL:
/// some are wrong. Else the errors of Builder::Build and Gatherer::Gather.
absl::Status CheckChoices(Builder& builder, const ChoicePlan& plan,
                          const std::function<absl::Status(const ChoiceRow&)>& take,
                          const std::function<void(const std::string&)>& progress);

/// A line for the names of the columns and one for a row, each with its end.
std::string ChoiceCsvHeader();
std::string ChoiceCsvLine(const ChoiceRow& row);

/// For people: the worst and the median ratio of each set and number of photons.
std::string ChoiceTable(const std::vector<ChoiceRow>& rows);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BENCH_CHOICE_CHECK_H_
