#ifndef TREELIGHT_CLIENT_BENCH_BENCH_CELL_H_
#define TREELIGHT_CLIENT_BENCH_BENCH_CELL_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/bench/bench_plan.h"
#include "client/bench/bench_row.h"
#include "core/builder.h"
#include "core/floors.h"

namespace treelight::client {

/// What is measured.
struct BenchDevice {
  Builder& builder;
  FloorMeter* floors = nullptr;  ///< null: floors are left out
  std::string machine{};         ///< its processor and threads
  std::string name{};            ///< of the device
  std::uint32_t threads = 0;     ///< of this program, that work; 0: others do
  /// Memory that this process may use, bytes; 0: not known.
  std::uint64_t host_bytes = 0;
  bool maps_on_host = false;  ///< maps lie in that memory
};

/// Takes what a cell gives.
struct BenchListener {
  std::function<absl::Status(const BenchRow&)> row;  ///< an error of it ends the run
  std::function<void(const std::string&)> progress;  ///< one line on what is under way
  std::function<void(const std::string&)> note;      ///< one line on what is left out, and why
};

struct CellOutcome {
  std::vector<std::string> wrong;  ///< figures that are not reported, and what is wrong with them
  std::uint64_t map_bytes = 0;     ///< of all maps together
};

/// Builds every tree and makes every gather of `cell`, in turns: a turn has each of them once, and
/// the first turn is not timed. r1 is found in the first tree. After each timed build 256 queries
/// are judged, after each gather those of its own. The errors of Builder::Build and of
/// Gatherer::Gather.
absl::StatusOr<CellOutcome> MeasureCell(const BenchDevice& device, const BenchCell& cell,
                                        const BenchListener& listener);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BENCH_BENCH_CELL_H_
