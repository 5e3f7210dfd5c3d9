#include "client/estimators/estimators.h"

#include <memory>
#include <string>
#include <vector>

#include "client/commands/command.h"
#include "client/commands/report.h"
#include "client/estimators/charts.h"
#include "client/estimators/float_sums.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  EstimatorPlan plan;
  std::uint64_t most_summed = 100'000'000, most_gathered = 10'000'000;
  std::string device;
  Report report = {.folder = "estimators", .from = {}};
};

absl::Status Measure(const Options& options) {
  const auto builder = MakeDeviceBuilder({.device = options.device, .cache_directory = {}});
  if (!builder.ok()) return builder.status();
  const auto estimators = [&](const auto& write) {
    std::uint64_t photons = 0;  // of the last row
    return MeasureEstimators(**builder, options.plan, [&](const EstimatorRow& row) {
      if (row.photons != photons) fmt::print(stderr, "{} photons\n", row.photons);
      photons = row.photons;
      return write(EstimatorCsvLine(row));
    });
  };
  const auto status =
      WriteLines(options.report.File("estimators.csv"), EstimatorCsvHeader(), estimators);
  if (!status.ok()) return status;
  const auto sums = [&](const auto& write) {
    return MeasureFloatSums(**builder, options.most_summed, options.most_gathered,
                            options.plan.seed, [&](const FloatSumRow& row) {
                              fmt::print(stderr, "{}, {} photons: off by {:.2g}\n", row.method,
                                         row.photons, row.error);
                              return write(FloatSumCsvLine(row));
                            });
  };
  return WriteLines(options.report.File("sums.csv"), FloatSumCsvHeader(), sums);
}

absl::Status Run(const Options& options) {
  const auto csv_paths = MeasureReport(options.report, {"estimators.csv", "sums.csv"},
                                       [&] { return Measure(options); });
  if (!csv_paths.ok() || !options.report.charts) return csv_paths.status();
  return DrawEstimatorCharts(*csv_paths, options.report.folder);
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
  AddReportOptions(*command, options->report, "estimators.csv and sums.csv",
                   "estimators.csv, sums.csv");
  command->callback([options, &global] { global.action = [options] { return Run(*options); }; });
}

}  // namespace treelight::client
