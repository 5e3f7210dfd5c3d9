#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/interrupt.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/load/load_table.h"
#include "client/output_file.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

const std::map<std::string, Arrivals> kOpenArrivals = {{"constant", Arrivals::kConstant},
                                                       {"poisson", Arrivals::kPoisson}};
// That the map outlives the run, should this program end without deleting it.
constexpr double kSpareSeconds = 600;
constexpr std::chrono::milliseconds kLongestLife = std::chrono::days(30);  // photon_map.proto

// Of the wire: a position and a power.
constexpr std::uint64_t kPhotonBytes = 24;
constexpr const char* kTable = "load.csv";
constexpr std::uint32_t kClosedWorkers = 8, kOpenWorkers = 64;

struct Options {
  LoadOptions load{.arrivals = Arrivals::kPoisson};
  std::vector<double> rates, shares;  // both empty: closed loop
  std::uint32_t workers = 0;          // 0: kClosedWorkers or kOpenWorkers
  double duration_s = 10;
  std::uint64_t photons = 1'000'000;
  std::string csv_path, output;
  std::vector<std::string> from;
  bool charts = true;
};

std::chrono::milliseconds TimeToLive(const Options& options) {
  const auto runs = static_cast<double>(1 + options.rates.size() + options.shares.size());
  const std::chrono::duration<double> seconds(runs * options.duration_s + kSpareSeconds);
  return std::min(kLongestLife, std::chrono::duration_cast<std::chrono::milliseconds>(seconds));
}

/// One run: closed where `rate` is 0. Says on stderr where it has no tail.
LoadRun RunOnce(PhotonMapClient& client, const MapRef& map, const Options& options, double rate,
                double share) {
  LoadOptions load = options.load;
  load.duration = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * options.duration_s));
  load.rate = rate;
  if (rate == 0) load.arrivals = Arrivals::kClosed;
  load.interrupted = &InterruptGuard::interrupted;
  load.workers = options.workers > 0 ? options.workers : rate == 0 ? kClosedWorkers : kOpenWorkers;
  LoadRun run{.options = load, .share = share, .result = RunLoad(client, map, load)};
  if (!run.result.IsSound(0.999)) {
    Warn(fmt::format(
        "at {:g} requests/s {} of {} sends were late by more than 1 ms, so there is no {}: {} "
        "workers are too few, this machine is too busy, or the server is past its capacity",
        rate, run.result.late, run.result.sent(), run.result.IsSound(0.99) ? "p99.9" : "p99",
        load.workers));
  }
  return run;
}

/// What a closed run has answered, requests/s.
double Capacity(const LoadRun& run) {
  std::uint64_t ok = 0;
  for (const KindResult& kind : run.result.kinds) ok += kind.ok;
  return static_cast<double>(ok) / run.result.seconds;
}

std::vector<LoadRun> RunAll(PhotonMapClient& client, const MapRef& map, const Options& options) {
  std::vector<LoadRun> runs;
  if (options.rates.empty()) runs.push_back(RunOnce(client, map, options, 0, 0));
  for (const double rate : options.rates) {
    if (InterruptGuard::interrupted()) return runs;
    runs.push_back(RunOnce(client, map, options, rate, 0));
  }
  const double capacity = options.shares.empty() ? 0 : Capacity(runs.front());
  if (capacity == 0) return runs;
  for (const double share : options.shares) {
    if (InterruptGuard::interrupted()) return runs;
    runs.push_back(RunOnce(client, map, options, share * capacity, share));
  }
  return runs;
}

std::string InFolder(const Options& options, const char* name) {
  return (std::filesystem::path(options.output) / name).string();
}

/// The files for the table, each of them once.
absl::StatusOr<std::vector<OutputFile>> OpenTables(const Options& options) {
  std::set<std::string> paths;
  if (!options.csv_path.empty()) paths.insert(options.csv_path);
  if (!options.output.empty()) paths.insert(InFolder(options, kTable));
  std::vector<OutputFile> files;
  for (const std::string& path : paths) {
    auto file = OutputFile::Create(path);
    if (!file.ok()) return file.status();
    files.push_back(*std::move(file));
  }
  return files;
}

/// The table, also in `files`, and the charts that were asked for.
absl::Status Report(const std::vector<LoadRun>& runs, std::vector<OutputFile>& files,
                    const Options& options) {
  fmt::print("{}", Format({.head = LoadColumns(), .rows = LoadRows(runs)}));
  for (OutputFile& file : files) {
    if (auto status = WriteLoadCsv(file, runs); !status.ok()) return status;
  }
  const bool open = !options.rates.empty() || !options.shares.empty();
  if (options.output.empty() || !open || !options.charts || InterruptGuard::interrupted())
    return absl::OkStatus();
  // The numbers are what was asked for: they do not fail for want of Python.
  if (auto status = DrawLoadCharts({InFolder(options, kTable)}, options.output); !status.ok()) {
    Warn({status.message().data(), status.message().size()});
  }
  return absl::OkStatus();
}

/// What the server would refuse in any case, before the numbers are made.
absl::Status CheckLimits(const Options& options, const v1::ServerLimits& limits) {
  const auto refuse = [](std::string_view option, std::uint64_t value, std::uint64_t most,
                         std::string_view flag) {
    return absl::InvalidArgumentError(fmt::format(
        "{} is {}, the server takes at most {} ({} of treelightd)", option, value, most, flag));
  };
  const std::uint64_t build_photons = options.load.build_share > 0 ? options.load.build_photons : 0;
  if (options.photons > limits.max_photons())
    return refuse("--photons", options.photons, limits.max_photons(), "--max-photons");
  if (build_photons > limits.max_photons())
    return refuse("--build-photons", build_photons, limits.max_photons(), "--max-photons");
  // An upload counts there as long as it lasts.
  const std::uint64_t most = limits.memory_bytes() / kPhotonBytes;
  if (const std::uint64_t photons = std::max(options.photons, build_photons); photons > most) {
    return refuse(options.photons > most ? "--photons" : "--build-photons", photons, most,
                  "--memory-limit");
  }
  return absl::OkStatus();
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  if (auto status = options.output.empty() ? absl::OkStatus() : MakeFolder(options.output);
      !status.ok())
    return status;
  if (!options.from.empty()) return DrawLoadCharts(options.from, options.output);
  auto files = OpenTables(options);
  if (!files.ok()) return files.status();
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto info = (*client)->GetServerInfo();
  if (!info.ok()) return info.status();
  if (auto status = CheckLimits(options, info->limits()); !status.ok()) return status;
  // What is refused is counted, not repeated.
  (*client)->SetRetryPatience({});
  const MapRef name{.name = fmt::format("load-{:08x}", std::random_device{}())};
  // From here on a map may be there to delete.
  const InterruptGuard guard;
  const auto built =
      (*client)->BuildPhotonMap(name.name, MakeLoadPhotons(options.photons, options.load.seed),
                                {.time_to_live = TimeToLive(options)});
  if (!built.ok()) return built.status();
  const MapRef map{.name = name.name, .version = built->map().version()};
  const std::vector<LoadRun> runs = RunAll(**client, map, options);
  (void)(*client)->DeletePhotonMap(map);
  absl::Status failure;
  for (const LoadRun& run : runs) {
    for (const KindResult& kind : run.result.kinds) failure.Update(kind.first_failure);
  }
  const absl::Status reported = Report(runs, *files, options);
  if (!reported.ok()) return reported;
  return InterruptGuard::interrupted()
             ? absl::CancelledError("interrupted; what was measured is above")
             : failure;
}

}  // namespace

void AddLoadCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "load",
      "Sends gathers and builds to the server and tells how long they take. Closed loop: each "
      "worker sends the next request once the last is answered. With --rates or --sweep, open "
      "loop: "
      "requests are sent when they are due, and latency counts from then");
  LoadOptions& load = options->load;
  command
      ->add_option("--rates", options->rates, "Open loop: requests/s, one run for each: 10,20,40")
      ->delimiter(',')
      ->check(NumberIn(0.01, 1e6));
  command
      ->add_option("--sweep", options->shares,
                   "Open loop after a closed one: shares of what that has reached, one run for "
                   "each: 0.25,0.5,0.8,1,1.2")
      ->delimiter(',')
      ->check(NumberIn(0.001, 100))
      ->excludes("--rates");
  command->add_option("--arrivals", load.arrivals, "Of the open loop: poisson or constant")
      ->transform(CLI::Validator(
          [](std::string& text) {
            const auto arrivals = kOpenArrivals.find(text);
            if (arrivals == kOpenArrivals.end())
              return fmt::format("'{}' is neither poisson nor constant", text);
            text = fmt::to_string(static_cast<int>(arrivals->second));
            return std::string();
          },
          ""))
      ->default_str("poisson");
  command->add_option("--duration", options->duration_s, "Seconds of each run")
      ->check(NumberIn(0.01, 86'400))
      ->capture_default_str();
  command
      ->add_option("--workers", options->workers,
                   "Requests that may be under way; else 8 in the closed loop, 64 in the open one")
      ->check(CLI::Range(1, 1024));
  command->add_option("--photons", options->photons, "Photons of the map that is gathered from")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000}))
      ->capture_default_str();
  command->add_option("--queries", load.queries, "Queries of one gather")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000}))
      ->capture_default_str();
  command->add_option("--k", load.gather.k, "Neighbours of a query")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  command->add_option("--radius", load.gather.radius, "Of a query; photons lie in the unit cube")
      ->check(NumberIn(0, 1e18))
      ->capture_default_str();
  command->add_option("--builds", load.build_share, "Share of the requests that are builds, [0, 1]")
      ->check(NumberIn(0, 1))
      ->capture_default_str();
  command->add_option("--build-photons", load.build_photons, "Photons of one build")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000}))
      ->capture_default_str();
  command->add_option("--seed", load.seed, "Of points and arrivals")->capture_default_str();
  command->add_option("--csv", options->csv_path, "Writes the table as CSV");
  CLI::Option* const output = command->add_option(
      "--output", options->output, "Folder for load.csv and, of the open loop, load.png and .svg");
  command
      ->add_option("--from", options->from,
                   "Sends nothing: draws the charts of these load.csv files")
      ->delimiter(',')
      ->needs(output);
  command->add_flag("!--no-charts", options->charts, "Leaves the charts out");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
