#include "client/estimators/charts.h"

#include "client/chart_script.h"
#include "client/estimators/charts_script.h"

namespace treelight::client {

absl::Status DrawEstimatorCharts(const std::vector<std::string>& csv_paths,
                                 const std::string& folder) {
  return RunChartScript(kEstimatorCharts, csv_paths, folder);
}

}  // namespace treelight::client
