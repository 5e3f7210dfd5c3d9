#ifndef TREELIGHT_CLIENT_BENCH_BENCH_ROW_H_
#define TREELIGHT_CLIENT_BENCH_BENCH_ROW_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace treelight::client {

/// Least, middle and largest of repeated times, milliseconds.
struct Spread {
  double min_ms = 0, median_ms = 0, max_ms = 0;
};

/// Of `times_ms`, which are some; of an even number the mean of the two in the middle.
Spread MakeSpread(std::vector<double> times_ms);

/// One figure of `treelight bench`: a line of its CSV.
struct BenchRow {
  std::string figure{};    ///< "build", "stage" of a build, "floor" of builds, "gather"
  std::string name{};      ///< of a build "whole", of a stage "sort", of a gather "k 50 in r1"
  std::string set{};       ///< "W1", "W2", "W3"
  std::uint32_t seed = 0;  ///< of the set
  bool fresh = false;      ///< the seed was drawn for this run: nobody can have tuned for it
  std::uint64_t photons = 0;
  std::string builder{};        ///< empty for floors, as leaf_size is 0
  std::uint32_t leaf_size = 0;  ///< B, photons
  std::uint32_t k = 0;          ///< of a gather; 0: no cap
  float radius = 0;             ///< of a gather, scene units; may be infinite
  std::string answers{};        ///< of a gather: "lists", "density", "count"
  std::string order{};          ///< of its queries: "random", "sorted"
  std::uint64_t queries = 0;
  std::uint32_t threads = 0;      ///< of the CPU; 0: the work was not on this program's threads
  std::uint32_t repetitions = 0;  ///< that the spreads are of
  Spread device{};                ///< the device's own time, copies to and from it left out
  std::optional<Spread> wall{};   ///< of the whole call; stages and floors have none
  /// Photons, pairs, bytes read and written, or gathers in a second of the median device time.
  double per_second = 0;
  std::uint32_t checked = 0;  ///< queries of each repetition that brute force in double confirmed
  std::string machine{};      ///< its processor and threads
  std::string device_name{};
};

/// The first line of the CSV, with its end.
std::string BenchCsvHeader();

/// `row` as a line of the CSV, with its end.
std::string BenchCsvLine(const BenchRow& row);

/// Builds and gathers as a table for people.
std::string BenchTable(const std::vector<BenchRow>& rows);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BENCH_BENCH_ROW_H_
