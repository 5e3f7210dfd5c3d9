#include "client/study/charts.h"

#include "client/chart_script.h"
#include "client/study/charts_script.h"

namespace treelight::client {

absl::Status DrawCharts(const std::vector<std::string>& csv_paths, const std::string& folder) {
  return RunChartScript(kStudyCharts, csv_paths, folder);
}

}  // namespace treelight::client
