#include "client/commands/report.h"

#include <filesystem>

#include "client/commands/output.h"
#include "client/output_file.h"
#include "fmt/format.h"

namespace treelight::client {

std::string Report::File(const std::string& name) const {
  return (std::filesystem::path(folder) / name).string();
}

CLI::Option* AddReportOptions(CLI::App& command, Report& report, const std::string& measured,
                              const std::string& written) {
  CLI::Option* const from =
      command
          .add_option("--from", report.from,
                      fmt::format("Measures nothing: takes the rows of these {} files", measured))
          ->type_name("FILE");
  command
      .add_option("--output", report.folder,
                  fmt::format("Folder for {} and the charts", written.empty() ? measured : written))
      ->capture_default_str()
      ->type_name("FOLDER");
  command.add_flag("!--no-charts", report.charts, "Leaves the charts out");
  return from;
}

absl::StatusOr<std::vector<std::string>> MeasureReport(
    const Report& report, const std::vector<std::string>& measured,
    const std::function<absl::Status()>& measure) {
  if (auto status = MakeFolder(report.folder); !status.ok()) return status;
  if (!report.from.empty()) return report.from;
  if (auto status = measure(); !status.ok()) return status;
  std::vector<std::string> paths;
  for (const std::string& name : measured) paths.push_back(report.File(name));
  return paths;
}

absl::Status WriteLines(
    const std::string& path, std::string_view header,
    const std::function<absl::Status(const std::function<absl::Status(std::string_view)>& write)>&
        measure) {
  auto file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  if (auto status = file->Write(header); !status.ok()) return status;
  absl::Status status = measure([&](std::string_view line) { return file->Write(line); });
  status.Update(file->Commit());
  return status;
}

}  // namespace treelight::client
