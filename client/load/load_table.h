#ifndef TREELIGHT_CLIENT_LOAD_LOAD_TABLE_H_
#define TREELIGHT_CLIENT_LOAD_LOAD_TABLE_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/load/load_run.h"
#include "client/output_file.h"

namespace treelight::client {

/// One run of a load and what came of it.
struct LoadRun {
  LoadOptions options;
  double share = 0;  ///< of the capacity that was measured, which it offers; 0: not asked so
  LoadResult result;
};

/// Names of the columns, as the CSV has them: offered_per_s and late are of both kinds together.
const std::vector<std::string>& LoadColumns();

/// A row for each kind of request that was sent; empty is what does not apply, a p99 or p99.9 for
/// which LoadResult::IsSound() says no, a p99 of fewer than 100 answers and a p99.9 of fewer than
/// 1000.
std::vector<std::vector<std::string>> LoadRows(const std::vector<LoadRun>& runs);

/// Writes LoadColumns() and LoadRows(), all that `file` gets. The errors of OutputFile.
absl::Status WriteLoadCsv(OutputFile& file, const std::vector<LoadRun>& runs);

/// Draws load.png and load.svg into `folder` by Python's matplotlib: latency, and answers/s,
/// against the offered load. The script stays there as charts.py. NOT_FOUND names a file that is
/// not there; else the errors of RunChartScript.
absl::Status DrawLoadCharts(const std::vector<std::string>& csv_paths, const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_LOAD_LOAD_TABLE_H_
