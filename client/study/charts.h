#ifndef TREELIGHT_CLIENT_STUDY_CHARTS_H_
#define TREELIGHT_CLIENT_STUDY_CHARTS_H_

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace treelight::client {

/// Draws the charts of a study as PNG and SVG into `folder`, by Python's matplotlib: table1, the
/// paper's table as bars beside ours; leaf_sizes, nodes against distance tests; build_times, nodes
/// against the time of the build. A chart whose rows are not there is left out. The script stays in
/// the folder as charts.py.
/// FAILED_PRECONDITION: Python or matplotlib is missing; the message says what to install.
absl::Status DrawCharts(const std::vector<std::string>& csv_paths, const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_CHARTS_H_
