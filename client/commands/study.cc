#include "client/study/study.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/report.h"
#include "client/commands/server_option.h"
#include "client/output_file.h"
#include "client/study/charts.h"
#include "client/study/study_scene.h"
#include "client/study/summary.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  StudyPlan plan;
  Report report = {.folder = "study", .from = {}};
  bool quick = false;
};

/// What can be seen in seconds: one built-in scene, few photons, few kinds of trees.
StudyPlan QuickPlan() {
  return {.scenes = {"conference"},
          .scene_folder = {},
          .seeds = 2,
          .queries = 300,
          .image_photons = 10'000,
          .light_photons = {10'000},
          .leaf_sizes = {4, 8, 16, 32},
          .hard_photons = 2'000,
          .few = true};
}

absl::Status WriteFile(const std::string& path, const std::string& text) {
  auto file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  if (auto status = file->Write(text); !status.ok()) return status;
  return file->Commit();
}

absl::Status Measure(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto measure = [&](const auto& write) {
    PhotonSetName photons;  // of the last row
    const StudyListener listener{.row =
                                     [&](const StudyRow& row) {
                                       if (row.photons != photons) {
                                         photons = row.photons;
                                         fmt::print(stderr, "{}, {}{}{}, {} photons, seed {}\n",
                                                    photons.scene, photons.set,
                                                    photons.camera.empty() ? "" : " ",
                                                    photons.camera, photons.photons, photons.seed);
                                       }
                                       return write(StudyCsvLine(row));
                                     },
                                 .note = [](const std::string& line) { Warn(line); }};
    return RunStudy(**client, options.plan, listener);
  };
  return WriteLines(options.report.File("study.csv"), StudyCsvHeader(), measure);
}

absl::StatusOr<std::vector<StudyRow>> Read(const std::vector<std::string>& paths) {
  std::vector<StudyRow> rows;
  for (const std::string& path : paths) {
    std::ifstream stream(path, std::ios::binary);
    if (!stream) return absl::NotFoundError(fmt::format("{} cannot be read", path));
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    auto more = ParseStudyCsv(text, path);
    if (!more.ok()) return more.status();
    std::move(more->begin(), more->end(), std::back_inserter(rows));
  }
  return rows;
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const Report& report = options.report;
  const auto csv_paths =
      MeasureReport(report, {"study.csv"}, [&] { return Measure(options, global); });
  if (!csv_paths.ok()) return csv_paths.status();
  const auto rows = Read(*csv_paths);  // what is summed up is what is written
  if (!rows.ok()) return rows.status();
  const std::vector<SummaryRow> summary = Summarise(*rows);
  if (auto status = WriteFile(report.File("summary.csv"), SummaryCsv(summary)); !status.ok())
    return status;
  const std::string tables = SummaryTables(summary);
  if (auto status = WriteFile(report.File("summary.txt"), tables); !status.ok()) return status;
  fmt::print("{}", tables);
  return report.charts ? DrawCharts(*csv_paths, report.folder) : absl::OkStatus();
}

std::vector<std::string> StudyLabels() {
  std::vector<std::string> labels;
  for (const std::uint32_t leaf_size : {8u, 1u}) {
    for (const Variant& variant : StudyVariants(VariantChoice::kAll, leaf_size)) {
      const std::string label = Label(variant);
      if (std::find(labels.begin(), labels.end(), label) == labels.end()) labels.push_back(label);
    }
  }
  return labels;
}

void AddPlanOptions(CLI::App& command, StudyPlan& plan) {
  command
      .add_option("--scenes", plan.scene_folder,
                  "Folder of sibenik/, dragon/ and conference/; without them built-in scenes "
                  "stand in")
      ->envname("TREELIGHT_SCENES")
      ->type_name("FOLDER");
  command.add_option("--scene", plan.scenes, "Which of the scenes")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::IsMember(StudySceneNames()));
  command.add_option("--seeds", plan.seeds, "How often all is repeated with other photons")
      ->capture_default_str()
      ->check(CLI::Range(1u, 100u));
  command.add_option("--first-seed", plan.first_seed, "The first of the seeds")
      ->capture_default_str()
      ->check(CLI::Range(1u, 1'000'000u));
  command.add_option("--searches", plan.queries, "Searches in each tree")
      ->capture_default_str()
      ->check(CLI::Range(1u, 1'000'000u));
  command
      .add_option("--image-photons", plan.image_photons,
                  "Of each of two cameras, with leaves of one photon; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{100'000'000}));
  command
      .add_option("--light-photons", plan.light_photons,
                  "With leaves of 8; from 1000000 on fewer kinds of trees. May be several; none: 0")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{100'000'000}));
  command
      .add_option("--leaf-sizes", plan.leaf_sizes,
                  "For which some kinds of trees are measured over the fewest of --light-photons")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1u, 64u));
  command
      .add_option("--hard-photons", plan.hard_photons,
                  "Of each input on which builders fail; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{10'000'000}));
  command
      .add_option("--timed-gathers", plan.timed_gathers,
                  "Density estimates of light photons that are timed in each tree; 100000 keep a "
                  "GPU busy")
      ->capture_default_str()
      ->check(CLI::Range(0u, 10'000'000u));
  command.add_flag("--few", plan.few, "Fewer kinds of trees");
  command
      .add_option(
          "--tree", plan.labels,
          "Only these kinds, and the baseline: \"hybrid isa+leaf 256\", \"isa+leaf\"; may be "
          "given more than once")
      ->check(CLI::IsMember(StudyLabels()))
      ->type_name("LABEL");
}

}  // namespace

void AddStudyCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "study", "Judges every kind of tree by what searches cost in it: the paper's experiment");
  AddPlanOptions(*command, options->plan);
  CLI::Option* quick =
      command->add_flag("--quick", options->quick,
                        "A look in seconds: one built-in scene, few photons and kinds of trees");
  const std::vector<CLI::Option*> of_plan = command->get_options();
  CLI::Option* from = AddReportOptions(*command, options->report, "study.csv",
                                       "study.csv, summary.csv, summary.txt");
  // Both leave the plan unread; --scenes may come from the environment.
  from->excludes(quick);
  for (CLI::Option* option : of_plan) {
    if (option == quick || option == command->get_help_ptr() || !option->get_envname().empty()) {
      continue;
    }
    option->excludes(quick)->excludes(from);
  }
  command->callback([options, &global] {
    std::erase(options->plan.light_photons, 0u);
    if (options->quick) options->plan = QuickPlan();
    global.action = [options, &global] { return Run(*options, global); };
  });
}

}  // namespace treelight::client
