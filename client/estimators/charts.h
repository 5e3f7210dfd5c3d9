#ifndef TREELIGHT_CLIENT_ESTIMATORS_CHARTS_H_
#define TREELIGHT_CLIENT_ESTIMATORS_CHARTS_H_

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace treelight::client {

/// Draws the charts of `treelight estimators` as PNG and SVG into `folder`, by Python's matplotlib:
/// bias, by place; deviation, over k; caustic, error over photons; sums, error over photons. The
/// script stays in the folder as charts.py. FAILED_PRECONDITION: Python or matplotlib is missing;
/// the message says what to install.
/// @param csv_paths  estimators.csv and sums.csv, in any order
absl::Status DrawEstimatorCharts(const std::vector<std::string>& csv_paths,
                                 const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ESTIMATORS_CHARTS_H_
