#ifndef TREELIGHT_CLIENT_LOAD_LOAD_TABLE_H_
#define TREELIGHT_CLIENT_LOAD_LOAD_TABLE_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/load/load_run.h"

namespace treelight::client {

/// One run of a load and what came of it.
struct LoadRun {
  LoadOptions options;
  double share = 0;  ///< of the capacity that was measured, which it offers; 0: not asked so
  LoadResult result;
};

/// Names of the columns, as the CSV has them: offered_per_s and late are of both kinds together.
const std::vector<std::string>& LoadColumns();

/// A row for each kind of request that was sent: numbers alone; empty is what does not apply, or a
/// p99 and beyond where LoadResult::tail_is_sound() says no.
std::vector<std::vector<std::string>> LoadRows(const std::vector<LoadRun>& runs);

/// Writes LoadColumns() and LoadRows(). The errors of OutputFile.
absl::Status WriteLoadCsv(const std::string& path, const std::vector<LoadRun>& runs);

/// Draws load.png and load.svg into `folder` by Python's matplotlib: latency, and answers/s,
/// against the offered load. The script stays there as charts.py. The errors of RunChartScript.
absl::Status DrawLoadCharts(const std::vector<std::string>& csv_paths, const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_LOAD_LOAD_TABLE_H_
