#include "client/estimators/estimators.h"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/estimators/charts.h"
#include "client/estimators/float_sums.h"
#include "client/output_file.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  EstimatorPlan plan;
  std::uint64_t most_summed = 100'000'000, most_gathered = 10'000'000;
  std::string device;
  std::string output = "estimators";
  std::vector<std::string> from;  // estimators.csv and sums.csv
  bool charts = true;
};

std::string InFolder(const Options& options, const std::string& name) {
  return (std::filesystem::path(options.output) / name).string();
}

/// Writes the rows that `measure` tells, also where it ends with an error.
template <typename Row, typename Measure>
absl::Status WriteRows(const std::string& path, const std::string& header,
                       std::string (*line)(const Row& row), const Measure& measure) {
  auto file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  if (auto status = file->Write(header); !status.ok()) return status;
  absl::Status status = measure([&](const Row& row) { return file->Write(line(row)); });
  status.Update(file->Commit());
  return status;
}

absl::Status Measure(const Options& options) {
  const auto builder = MakeDeviceBuilder({.device = options.device, .cache_directory = {}});
  if (!builder.ok()) return builder.status();
  std::uint64_t photons = 0;  // of the last row
  const auto estimators = WriteRows<EstimatorRow>(
      InFolder(options, "estimators.csv"), EstimatorCsvHeader(), EstimatorCsvLine,
      [&](const auto& write) {
        return MeasureEstimators(**builder, options.plan, [&](const EstimatorRow& row) {
          if (row.photons != photons) fmt::print(stderr, "{} photons\n", row.photons);
          photons = row.photons;
          return write(row);
        });
      });
  if (!estimators.ok()) return estimators;
  return WriteRows<FloatSumRow>(
      InFolder(options, "sums.csv"), FloatSumCsvHeader(), FloatSumCsvLine, [&](const auto& write) {
        return MeasureFloatSums(**builder, options.most_summed, options.most_gathered,
                                options.plan.seed, [&](const FloatSumRow& row) {
                                  fmt::print(stderr, "{}, {} photons: off by {:.2g}\n", row.method,
                                             row.photons, row.error);
                                  return write(row);
                                });
      });
}

absl::Status Run(const Options& options) {
  if (auto status = MakeFolder(options.output); !status.ok()) return status;
  std::vector<std::string> csv_paths = options.from;
  if (csv_paths.empty()) {
    if (auto status = Measure(options); !status.ok()) return status;
    csv_paths = {InFolder(options, "estimators.csv"), InFolder(options, "sums.csv")};
  }
  return options.charts ? DrawEstimatorCharts(csv_paths, options.output) : absl::OkStatus();
}

}  // namespace

void AddEstimatorsCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("estimators",
                                         "Measures bias and deviation of density estimates where "
                                         "the density is known, in this program");
  command->add_option("--photons", options->plan.photons, "Of each surface; may be several")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1'000}, std::uint64_t{100'000'000}));
  command->add_option("--k", options->plan.ks, "Neighbours; may be several")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(3u, kMaxNeighbors));
  command->add_option("--seed", options->plan.seed, "Of all photons")->capture_default_str();
  command
      ->add_option("--total-photons", options->plan.total_photons,
                   "Of all repetitions of one surface together, about")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1'000}, std::uint64_t{10'000'000'000}));
  command
      ->add_option("--summed", options->most_summed,
                   "Photons whose sum in float is compared with that in double, at most")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{100}, std::uint64_t{10'000'000'000}));
  command
      ->add_option("--gathered", options->most_gathered,
                   "Of them, in one gather on the device, at most; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1'000'000'000}));
  command->add_option("--device", options->device,
                      "Index, or part of its name; default: the first");
  command
      ->add_option("--from", options->from,
                   "Measures nothing: draws the rows of these estimators.csv and sums.csv files")
      ->type_name("FILE");
  command
      ->add_option("--output", options->output,
                   "Folder for estimators.csv, sums.csv and the charts")
      ->capture_default_str()
      ->type_name("FOLDER");
  command->add_flag("!--no-charts", options->charts, "Leaves the charts out");
  command->callback([options, &global] { global.action = [options] { return Run(*options); }; });
}

}  // namespace treelight::client
