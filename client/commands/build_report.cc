#include "client/commands/build_report.h"

#include <string>

#include "client/commands/map_table.h"
#include "client/commands/output.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

std::string FormatTimings(const v1::Timings& timings) {
  return Format({.head = {"server", "time"},
                 .rows = {{"receive", FormatMicroseconds(timings.receive_us())},
                          {"queue", FormatMicroseconds(timings.queue_us())},
                          {"upload to the device", FormatMicroseconds(timings.upload_us())},
                          {"kernels", FormatMicroseconds(timings.kernel_us())},
                          {"in all", FormatMicroseconds(timings.total_us())}}});
}

}  // namespace

absl::Status PrintBuildReport(const v1::BuildPhotonMapResponse& built, bool json) {
  if (json) return PrintJson(built);
  fmt::print("{}\n{}", FormatMap(built.map()), FormatTimings(built.timings()));
  return absl::OkStatus();
}

}  // namespace treelight::client
