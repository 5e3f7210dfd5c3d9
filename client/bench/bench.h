#ifndef TREELIGHT_CLIENT_BENCH_BENCH_H_
#define TREELIGHT_CLIENT_BENCH_BENCH_H_

#include "absl/status/status.h"
#include "client/bench/bench_cell.h"
#include "client/bench/bench_plan.h"

namespace treelight::client {

/// Measures all cells of `plan`, one after the other. Where photons do not fit, the listener is
/// told why, and the cells of that set with as many are left out. Memory that a device says nothing
/// of is judged by an estimate: photons, what a build takes, and on a CPU the maps. INTERNAL: some
/// answers are wrong; their figures are not reported, all others are. Else the errors of MakeCells
/// and MeasureCell, RESOURCE_EXHAUSTED only where nothing was measured.
absl::Status RunBench(const BenchDevice& device, const BenchPlan& plan,
                      const BenchListener& listener);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BENCH_BENCH_H_
