#include "client/accuracy/accuracy.h"

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/accuracy/charts.h"
#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/output_file.h"
#include "client/scenes/load_scene.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  AccuracyPlan plan;
  std::vector<std::string> scenes = {"cornell"};
  std::string output = "accuracy";
  std::vector<std::string> from;  // accuracy.csv files
  bool charts = true;
};

std::string InFolder(const Options& options, const std::string& name) {
  return (std::filesystem::path(options.output) / name).string();
}

/// accuracy.csv has what was measured, also where it ends with an error.
absl::Status Measure(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  auto file = OutputFile::Create(InFolder(options, "accuracy.csv"));
  if (!file.ok()) return file.status();
  if (auto status = file->Write(AccuracyCsvHeader()); !status.ok()) return status;
  absl::Status status;
  for (const std::string& name : options.scenes) {
    auto loaded = LoadScene(name);
    if (!loaded.ok()) {
      status = loaded.status();
      break;
    }
    for (const std::string& note : loaded->notes) Warn(note);
    status = MeasureAccuracy(
        **client, std::move(loaded->scene), options.plan, [&](const AccuracyRow& row) {
          fmt::print(stderr, "{}, k {}, {} {:g}: density off by {:.2g}, {:.0f} ns\n", row.scene,
                     row.setting.k, KnobName(row.setting.knob), row.setting.value,
                     row.error.density, row.speed.kernel_ns);
          return file->Write(AccuracyCsvLine(row));
        });
    if (!status.ok()) break;
  }
  status.Update(file->Commit());
  return status;
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  if (auto status = MakeFolder(options.output); !status.ok()) return status;
  std::vector<std::string> csv_paths = options.from;
  if (csv_paths.empty()) {
    if (auto status = Measure(options, global); !status.ok()) return status;
    csv_paths = {InFolder(options, "accuracy.csv")};
  }
  return options.charts ? DrawAccuracyCharts(csv_paths, options.output) : absl::OkStatus();
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
  command
      ->add_option("--from", options->from,
                   "Measures nothing: draws the rows of these accuracy.csv files")
      ->type_name("FILE");
  command->add_option("--output", options->output, "Folder for accuracy.csv and the charts")
      ->capture_default_str()
      ->type_name("FOLDER");
  command->add_flag("!--no-charts", options->charts, "Leaves the charts out");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
