#include "client/accuracy/accuracy.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/accuracy/charts.h"
#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/report.h"
#include "client/commands/server_option.h"
#include "client/scenes/load_scene.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  AccuracyPlan plan;
  std::vector<std::string> scenes = {"cornell"};
  Report report = {.folder = "accuracy", .from = {}};
};

absl::Status Measure(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto measure = [&](const auto& write) {
    for (const std::string& name : options.scenes) {
      auto loaded = LoadScene(name);
      if (!loaded.ok()) return loaded.status();
      for (const std::string& note : loaded->notes) Warn(note);
      const auto status = MeasureAccuracy(
          **client, std::move(loaded->scene), options.plan, [&](const AccuracyRow& row) {
            fmt::print(stderr, "{}, k {}, {} {:g}: density off by {:.2g}, {:.0f} ns\n", row.scene,
                       row.setting.k, KnobName(row.setting.knob), row.setting.value,
                       row.error.density, row.speed.kernel_ns);
            return write(AccuracyCsvLine(row));
          });
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  };
  return WriteLines(options.report.File("accuracy.csv"), AccuracyCsvHeader(), measure);
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const auto csv_paths =
      MeasureReport(options.report, {"accuracy.csv"}, [&] { return Measure(options, global); });
  if (!csv_paths.ok() || !options.report.charts) return csv_paths.status();
  return DrawAccuracyCharts(*csv_paths, options.report.folder);
}

}  // namespace

void AddAccuracyCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "accuracy", "Measures what approximate gathers give up, and what they gain");
  command
      ->add_option("--scene", options->scenes,
                   "Built-in scenes, scene files or meshes; may be several")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--photons", options->plan.photons, "Photons of indirect light in each scene")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1'000}, std::uint64_t{100'000'000}));
  command->add_option("--seed", options->plan.seed, "Of photons and queries")
      ->capture_default_str();
  command->add_option("--queries", options->plan.queries, "Gathers of a batch that is timed")
      ->capture_default_str()
      ->check(CLI::Range(1u, 10'000'000u));
  command->add_flag(
      "--normals", options->plan.normals,
      "Gathers are at points that the camera sees, with their normals, not at photons");
  command
      ->add_option("--checked", options->plan.checked,
                   "Of them, whose answers are compared with brute force in double")
      ->capture_default_str()
      ->check(CLI::Range(1u, 100'000u));
  command->add_option("--runs", options->plan.runs, "Of each batch; the median counts")
      ->capture_default_str()
      ->check(CLI::Range(1u, 1'000u));
  command->add_option("--k", options->plan.ks, "Neighbours; may be several")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1u, kMaxNeighbors));
  command
      ->add_option("--max-relative-error", options->plan.errors,
                   "Errors of densities that are asked for; may be several")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1e-6, 0.999));
  command
      ->add_option("--batches", options->plan.batches,
                   "Batches of 4000 gathers that ask for each of them, and are compared with exact "
                   "ones")
      ->capture_default_str()
      ->check(CLI::Range(0u, 10'000u));
  command
      ->add_option("--picture-size", options->plan.picture_size,
                   "Pixels of a side of the pictures that are compared; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(0, 4096));
  command
      ->add_option("--reference-spp", options->plan.reference_spp,
                   "Samples per pixel of the path-traced reference")
      ->capture_default_str()
      ->check(CLI::Range(2u, 1'000'000u));
  AddReportOptions(*command, options->report, "accuracy.csv");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
