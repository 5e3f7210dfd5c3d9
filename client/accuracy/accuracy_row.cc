#include "client/accuracy/accuracy_row.h"

#include <algorithm>

#include "fmt/format.h"

namespace treelight::client {

std::string AccuracyCsvHeader() {
  return "scene,photons,seed,device,knob,value,k,radius,queries,checked,distance_error,recall,"
         "density_error,mean_bound,kernel_ns,whole_ns,picture_rmse,picture_relative_mse,picture_s,"
         "reference_noise,merged_photons,measured_error,batches,batches_within,"
         "request_bytes,answer_bytes,normals\n";
}

std::string AccuracyCsvLine(const AccuracyRow& row) {
  std::string device = row.device;  // without what would end the cell
  std::replace(device.begin(), device.end(), ',', ' ');
  return fmt::format(
      "{},{},{},{},{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.1f},{:.1f},{:.6g},{:.6g},"
      "{:.4g},{:.6g},{},{:.6g},{},{},{:.2f},{:.2f},{:d}\n",
      row.scene, row.photons, row.seed, device, KnobName(row.setting.knob), row.setting.value,
      row.setting.k, row.radius, row.queries, row.checked, row.error.distance, row.error.recall,
      row.error.density, row.error.bound, row.speed.kernel_ns, row.speed.whole_ns, row.picture.rmse,
      row.picture.relative_mse, row.picture.seconds, row.picture.reference_noise,
      row.merge.merged_photons, row.merge.measured_error, row.merge.batches,
      row.merge.batches_within, row.speed.request_bytes, row.speed.answer_bytes, row.normals);
}

}  // namespace treelight::client
