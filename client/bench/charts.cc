#include "client/bench/charts.h"

#include "client/bench/charts_script.h"
#include "client/chart_script.h"

namespace treelight::client {

absl::Status DrawBenchCharts(const std::vector<std::string>& csv_paths, const std::string& folder) {
  return RunChartScript(kBenchCharts, csv_paths, folder);
}

}  // namespace treelight::client
