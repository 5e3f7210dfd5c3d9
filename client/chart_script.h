#ifndef TREELIGHT_CLIENT_CHART_SCRIPT_H_
#define TREELIGHT_CLIENT_CHART_SCRIPT_H_

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

namespace treelight::client {

/// Writes `script`, which is Python, to FOLDER/charts.py beside chart_style.py, which it may
/// import, and runs it with `folder` and `csv_paths` as its arguments, so that it draws charts into
/// the folder. Both stay there. FAILED_PRECONDITION: Python is missing, or the script says what is;
/// the message says what to install. The errors of OutputFile.
absl::Status RunChartScript(std::string_view script, const std::vector<std::string>& csv_paths,
                            const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_CHART_SCRIPT_H_
