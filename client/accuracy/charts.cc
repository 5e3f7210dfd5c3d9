#include "client/accuracy/charts.h"

#include "client/accuracy/charts_script.h"
#include "client/chart_script.h"

namespace treelight::client {

absl::Status DrawAccuracyCharts(const std::vector<std::string>& csv_paths,
                                const std::string& folder) {
  return RunChartScript(kAccuracyCharts, csv_paths, folder);
}

}  // namespace treelight::client
