#ifndef TREELIGHT_CLIENT_ACCURACY_CHARTS_H_
#define TREELIGHT_CLIENT_ACCURACY_CHARTS_H_

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace treelight::client {

/// Draws the charts of `treelight accuracy` as PNG and SVG into `folder`, by Python's matplotlib:
/// density, the error of densities over the time of a gather, with the Pareto front; pictures, the
/// RMSE over the time of the picture. The script stays in the folder as charts.py.
/// FAILED_PRECONDITION: Python or matplotlib is missing; the message says what to install.
absl::Status DrawAccuracyCharts(const std::vector<std::string>& csv_paths,
                                const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ACCURACY_CHARTS_H_
