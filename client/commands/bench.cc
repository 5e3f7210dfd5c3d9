#include "client/bench/bench.h"

#include <algorithm>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "client/bench/charts.h"
#include "client/bench/choice_check.h"
#include "client/bench/remote_builder.h"
#include "client/build_names.h"
#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/report.h"
#include "client/commands/server_option.h"
#include "core/floors.h"
#include "core/machine_memory.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

const std::map<std::string, PointSet> kSets = {
    {"W1", PointSet::kUniform}, {"W2", PointSet::kSurfaces}, {"W3", PointSet::kTurned}};
constexpr std::uint64_t kGpuQueries = 1'000'000, kCpuQueries = 100'000;

struct Options {
  BenchPlan plan;
  bool queries_given = false, threads_given = false;
  std::uint32_t fresh_seeds = 1;
  bool local = false, quick = false, choices = false;
  DeviceOptions device;
  Report report = {.folder = "bench", .from = {}};
};

/// What is measured, and what it consists of.
struct OpenDevice {
  std::unique_ptr<PhotonMapClient> client;  // of a server
  std::unique_ptr<Builder> builder;
  std::unique_ptr<FloorMeter> floors;
  DeviceInfo info;
  std::string machine;
  std::uint64_t host_bytes = 0;  // memory that this process may use; 0: it does not matter
  bool is_own_cpu = false;       // the threads of this program
};

std::string MachineName(const std::string& processor, std::uint64_t threads) {
  return fmt::format("{}; {} threads", processor, threads);
}

/// The CPU of this machine.
DeviceInfo NativeCpu() {
  for (const DeviceInfo& device : ListDevices()) {
    if (device.platform == kNativePlatform) return device;
  }
  return {};
}

absl::StatusOr<OpenDevice> OpenLocal(const DeviceOptions& options) {
  OpenDevice device;
  auto info = ChooseDevice(options);
  if (!info.ok()) return info.status();
  device.info = *std::move(info);
  auto builder = MakeDeviceBuilder(options);
  if (!builder.ok()) return builder.status();
  device.builder = *std::move(builder);
  auto floors = MakeFloorMeter(options);
  if (!floors.ok()) return floors.status();
  device.floors = *std::move(floors);
  device.is_own_cpu = device.info.platform == kNativePlatform;
  const DeviceInfo cpu = NativeCpu();
  device.machine = MachineName(cpu.name, cpu.compute_units);
  device.host_bytes = MachineMemoryBytes();
  return device;
}

absl::StatusOr<OpenDevice> OpenServer(const GlobalOptions& global) {
  OpenDevice device;
  auto client = Connect(global);
  if (!client.ok()) return client.status();
  device.client = *std::move(client);
  const auto info = device.client->GetServerInfo();
  if (!info.ok()) return info.status();
  for (const v1::Device& other : info->devices()) {
    if (other.platform() == kNativePlatform) {
      device.machine = MachineName(other.name(), other.compute_units());
    }
    if (other.index() != info->device_index()) continue;
    device.info.name = other.name();
    device.info.type = other.type();
  }
  // What has no room is told, not waited for.
  device.client->SetRetryPatience({});
  device.builder = std::make_unique<RemoteBuilder>(*device.client);
  return device;
}

/// What the options leave to the device.
BenchPlan CompletePlan(const Options& options, const OpenDevice& device) {
  BenchPlan plan = options.plan;
  if (options.quick) {
    const BenchPlan given = plan;
    plan = QuickBenchPlan();
    plan.seed = given.seed;
  } else if (!options.queries_given) {
    plan.queries = device.info.type == "gpu" ? kGpuQueries : kCpuQueries;
  }
  if (!options.threads_given && device.is_own_cpu) {
    for (std::uint32_t threads = 1; threads < device.info.compute_units; threads *= 2) {
      plan.threads.push_back(threads);
    }
    plan.threads.push_back(device.info.compute_units);
  }
  std::random_device random;
  for (std::uint32_t i = 0; i < options.fresh_seeds; ++i) plan.fresh_seeds.push_back(random());
  return plan;
}

absl::Status Measure(const Options& options, const GlobalOptions& global) {
  auto device = options.local ? OpenLocal(options.device) : OpenServer(global);
  if (!device.ok()) return device.status();
  if (!device->is_own_cpu && options.threads_given) {
    return absl::InvalidArgumentError(fmt::format(
        "--threads: {} is not worked with by threads of this program; only with --local and the "
        "native CPU are they varied",
        device->info.name));
  }
  const BenchDevice measured{.builder = *device->builder,
                             .floors = device->floors.get(),
                             .machine = device->machine,
                             .name = device->info.name,
                             .threads = device->is_own_cpu ? device->info.compute_units : 0,
                             .host_bytes = device->host_bytes,
                             .maps_on_host = device->info.type == "cpu"};
  std::vector<BenchRow> rows;
  const auto measure = [&](const auto& write) {
    const BenchListener listener{
        .row =
            [&](const BenchRow& row) {
              rows.push_back(row);
              return write(BenchCsvLine(row));
            },
        .progress = [](const std::string& line) { fmt::print(stderr, "{}\n", line); },
        .note = [](const std::string& line) { Warn(line); }};
    return RunBench(measured, CompletePlan(options, *device), listener);
  };
  const auto status = WriteLines(options.report.File("bench.csv"), BenchCsvHeader(), measure);
  fmt::print("{}\n{}\n{}", device->info.name, device->machine, BenchTable(rows));
  return status;
}

/// What --builder auto takes, beside the best of what it may take.
absl::Status MeasureChoices(const Options& options) {
  auto device = OpenLocal(options.device);
  if (!device.ok()) return device.status();
  const BenchPlan plan = CompletePlan(options, *device);
  ChoicePlan choices{.sets = plan.sets,
                     .photons = plan.photons,
                     .queries = plan.queries,
                     .repetitions = plan.repetitions,
                     .seeds = plan.fresh_seeds};
  choices.seeds.insert(choices.seeds.begin(), plan.seed);
  std::vector<ChoiceRow> rows;
  const auto measure = [&](const auto& write) {
    return CheckChoices(
        *device->builder, choices,
        [&](const ChoiceRow& row) {
          rows.push_back(row);
          return write(ChoiceCsvLine(row));
        },
        [](const std::string& line) { fmt::print(stderr, "{}\n", line); });
  };
  const auto status = WriteLines(options.report.File("choices.csv"), ChoiceCsvHeader(), measure);
  fmt::print("{}\n{}\n{}", device->info.name, device->machine, ChoiceTable(rows));
  return status;
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const Report& report = options.report;
  if (options.choices) {
    return MeasureReport(report, {}, [&] { return MeasureChoices(options); }).status();
  }
  const auto csv_paths =
      MeasureReport(report, {"bench.csv"}, [&] { return Measure(options, global); });
  if (!csv_paths.ok() || !report.charts) return csv_paths.status();
  return DrawBenchCharts(*csv_paths, report.folder);
}

void AddPlanOptions(CLI::App& command, Options& options) {
  BenchPlan& plan = options.plan;
  const auto photons = CLI::Range(std::uint64_t{1'000}, std::uint64_t{1'000'000'000});
  command
      .add_option("--sets", plan.sets,
                  "W1: uniform in a cube; W2: on walls and spheres, with caustics and copies; W3: "
                  "W2 turned")
      ->delimiter(',')
      ->transform(CLI::CheckedTransformer(kSets))
      ->default_str("W1,W2,W3");
  command.add_option("--photons", plan.photons, "Of a map; those that do not fit are left out")
      ->delimiter(',')
      ->check(photons)
      ->capture_default_str();
  command
      .add_option("--detail-photons", plan.detail_photons,
                  "For which k and threads are varied and fresh seeds measured")
      ->check(photons)
      ->capture_default_str();
  command.add_option("--builders", plan.builders, "Kinds of trees")
      ->delimiter(',')
      ->check(CLI::IsMember(BuilderNames()))
      ->capture_default_str();
  command.add_option("--leaf-sizes", plan.leaf_sizes, "Photons of a leaf at most")
      ->delimiter(',')
      ->check(CLI::Range(1u, kMaxLeafSize))
      ->capture_default_str();
  command.add_option("--k", plan.ks, "Neighbours of the gathers by which k is varied")
      ->delimiter(',')
      ->check(CLI::Range(1u, kMaxNeighbors))
      ->capture_default_str();
  command.add_option("--queries", plan.queries, "Of a gather; 0: builds alone")
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{100'000'000}))
      ->default_str(fmt::format("{} on a GPU, else {}", kGpuQueries, kCpuQueries))
      ->each([&options](const std::string&) { options.queries_given = true; });
  command
      .add_option("--repetitions", plan.repetitions,
                  "How often each figure is measured, all of one set in turns")
      ->check(CLI::Range(1u, 1'000u))
      ->capture_default_str();
  command.add_option("--threads", plan.threads, "Of the native CPU, with --local")
      ->delimiter(',')
      ->check(CLI::Range(1u, 1'024u))
      ->default_str("1, 2, 4 and so on to all")
      ->each([&options](const std::string&) { options.threads_given = true; });
  command.add_option("--seed", plan.seed, "Of the sets")->capture_default_str();
  command
      .add_option("--fresh-seeds", options.fresh_seeds,
                  "Seeds drawn for this run, measured once the rest is done")
      ->check(CLI::Range(0u, 100u))
      ->capture_default_str();
}

}  // namespace

void AddBenchCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "bench",
      "Measures builds and gathers on a server's device, or with --local in this program: builds "
      "over photons with their stages, gathers over k, over photons and over threads. Answers are "
      "compared with brute force in double; wrong ones are not reported, and the exit code is 1");
  command->add_flag("--local", options->local,
                    "In this program; the floors of builds are measured then too");
  command
      ->add_option("--device", options->device.device,
                   "With --local: index or part of the name (treelight devices --local)")
      ->needs(command->get_option("--local"));
  command
      ->add_option("--cache-dir", options->device.cache_directory,
                   "With --local: folder of compiled kernels")
      ->needs(command->get_option("--local"));
  AddPlanOptions(*command, *options);
  command->add_flag("--quick", options->quick, "A look in seconds: W2, few photons and queries");
  for (const char* other : {"--sets", "--photons", "--detail-photons", "--builders", "--leaf-sizes",
                            "--k", "--queries", "--repetitions"}) {
    command->get_option("--quick")->excludes(command->get_option(other));
  }
  command
      ->add_flag(
          "--choices", options->choices,
          "With --local: what --builder auto takes instead, beside the best that it may take, "
          "for 1e3 to 1e9 gathers; writes choices.csv")
      ->needs(command->get_option("--local"));
  AddReportOptions(*command, options->report, "bench.csv");
  for (const char* other :
       {"--detail-photons", "--builders", "--leaf-sizes", "--k", "--threads", "--from"}) {
    command->get_option("--choices")->excludes(command->get_option(other));
  }
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
