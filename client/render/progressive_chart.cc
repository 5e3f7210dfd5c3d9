#include "client/render/progressive_chart.h"

#include "client/chart_script.h"
#include "client/render/progressive_chart_script.h"
#include "fmt/format.h"

namespace treelight::client {

std::string ErrorCurveHeader() {
  return "passes,seconds,photons,radius,caustic_radius,k,caustic_k,estimated_mse,"
         "estimated_variance,estimated_squared_bias,measured_mse,rmse,clipped_rmse,mean_ratio\n";
}

std::string ErrorCurveLine(const PassReport& pass, const std::optional<ImageError>& measured) {
  std::string line =
      fmt::format("{},{:.3f},{},{:.6g},{:.6g},{},{},", pass.passes, pass.seconds, pass.photons,
                  pass.indirect.radius, pass.caustic.radius, pass.indirect.k, pass.caustic.k);
  if (pass.error) {
    line += fmt::format("{:.6g},{:.6g},", pass.error->relative_mse(), pass.error->variance);
    if (pass.error->knows_bias) line += fmt::format("{:.6g}", pass.error->squared_bias);
  } else {
    line += ",,";
  }
  if (!measured) return line + ",,,,\n";
  return line + fmt::format(",{:.6g},{:.6g},{:.6g},{:.6g}\n", measured->relative_mse,
                            measured->rmse, measured->clipped_rmse, measured->mean_ratio);
}

absl::Status DrawErrorCurve(const std::string& csv_path, const std::string& folder) {
  return RunChartScript(kProgressiveChart, {csv_path}, folder);
}

}  // namespace treelight::client
