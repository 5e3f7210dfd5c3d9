#ifndef TREELIGHT_CLIENT_COMMANDS_REPORT_H_
#define TREELIGHT_CLIENT_COMMANDS_REPORT_H_

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace treelight::client {

/// What a command that measures leaves behind: a folder of CSV files and charts. With `from` it
/// measures nothing and draws the rows of earlier runs.
struct Report {
  std::string folder;
  std::vector<std::string> from;  // CSV files
  bool charts = true;

  /// The path of a file in the folder.
  std::string File(const std::string& name) const;
};

/// --from, --output and --no-charts.
/// @param measured  for the help: the CSV files that are measured: "bench.csv"
/// @param written   for the help: all files beside the charts, where these are more
/// @returns --from
CLI::Option* AddReportOptions(CLI::App& command, Report& report, const std::string& measured,
                              const std::string& written = {});

/// Makes the folder, and measures where the report is not drawn from earlier files.
/// @param measured  the names of the CSV files that `measure` writes
/// @returns the CSV files whose rows are reported
absl::StatusOr<std::vector<std::string>> MeasureReport(
    const Report& report, const std::vector<std::string>& measured,
    const std::function<absl::Status()>& measure);

/// Writes a file of what `measure` hands out, line by line, below `header`. What was measured is
/// written also where `measure` ends with an error.
absl::Status WriteLines(
    const std::string& path, std::string_view header,
    const std::function<absl::Status(const std::function<absl::Status(std::string_view)>& write)>&
        measure);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_REPORT_H_
