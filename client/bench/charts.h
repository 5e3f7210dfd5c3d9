#ifndef TREELIGHT_CLIENT_BENCH_CHARTS_H_
#define TREELIGHT_CLIENT_BENCH_CHARTS_H_

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace treelight::client {

/// Draws the charts of `treelight bench` as PNG and SVG into `folder`, by Python's matplotlib:
/// builds, their time over photons above the floors; stages, of which they consist; gathers_over_k;
/// gathers_over_photons; threads. A chart whose rows are not there is left out. The script stays in
/// the folder as charts.py.
/// FAILED_PRECONDITION: Python or matplotlib is missing; the message says what to install. Or a
/// file has not the columns of a bench.
absl::Status DrawBenchCharts(const std::vector<std::string>& csv_paths, const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BENCH_CHARTS_H_
