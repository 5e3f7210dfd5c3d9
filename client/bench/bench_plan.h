#ifndef TREELIGHT_CLIENT_BENCH_BENCH_PLAN_H_
#define TREELIGHT_CLIENT_BENCH_BENCH_PLAN_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/bench/workloads.h"
#include "core/builder.h"

namespace treelight::client {

/// What `treelight bench` measures.
struct BenchPlan {
  std::vector<PointSet> sets = {PointSet::kUniform, PointSet::kSurfaces, PointSet::kTurned};
  /// Of a map, ascending; what does not fit ends the list.
  std::vector<std::uint64_t> photons = {10'000, 100'000, 1'000'000, 10'000'000, 100'000'000};
  /// For which k and threads are varied, and the fresh seeds are measured.
  std::uint64_t detail_photons = 1'000'000;
  std::vector<std::string> builders = {"lbvh", "hybrid"};  ///< as BuilderName gives them
  std::vector<std::uint32_t> leaf_sizes = {8, 16, 32};
  std::vector<std::uint32_t> ks = {1, 2, 4, 8, 16, 32, 64, 100, 128, 256, 1024};
  std::uint64_t queries = 0;             ///< of a gather; 0: builds alone
  std::uint32_t repetitions = 5;         ///< of each figure, at least 1
  std::vector<std::uint32_t> threads{};  ///< of the CPU; empty: all that there are
  std::uint32_t seed = 1;
  std::vector<std::uint32_t> fresh_seeds{};  ///< drawn for this run
};

/// A kind of tree, and on how many threads of this program it is worked with; 0: all.
struct BenchSubject {
  BuildOptions options;
  std::uint32_t threads = 0;
};

/// One kind of gather.
struct BenchSearch {
  std::string name;  ///< "k 50 in r1", "density of 50 in r1", "count in r1"
  std::uint32_t k = 0;
  bool in_r1 = false;         ///< else without a radius
  std::uint32_t outputs = 0;  ///< mask of kOutput bits
  bool sorted = false;        ///< its queries come in Morton order
};

/// What is measured over one set of photons, turn by turn.
struct BenchCell {
  PointSet set = PointSet::kUniform;
  std::uint32_t seed = 0;
  bool fresh = false;
  std::uint64_t photons = 0;
  bool floors = false;
  std::vector<BenchSubject> subjects;
  std::vector<BenchSearch> searches;
  std::uint64_t queries = 0;
  std::uint32_t repetitions = 1;
};

/// A look in seconds.
BenchPlan QuickBenchPlan();

/// The cells of a plan, in the order in which they are measured: the sets by their photons, then
/// threads, then fresh seeds. INVALID_ARGUMENT: an option of a builder is out of range.
absl::StatusOr<std::vector<BenchCell>> MakeCells(const BenchPlan& plan);

/// "lists", "density", "count".
std::string NameOfAnswers(std::uint32_t outputs);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BENCH_BENCH_PLAN_H_
