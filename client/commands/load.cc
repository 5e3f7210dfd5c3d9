#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/load/load_run.h"
#include "client/output_file.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

const std::map<std::string, Arrivals> kOpenArrivals = {{"constant", Arrivals::kConstant},
                                                       {"poisson", Arrivals::kPoisson}};
// That the map outlives the run, should this program end without deleting it.
constexpr double kSpareSeconds = 600;

struct Options {
  LoadOptions load{.arrivals = Arrivals::kPoisson};
  std::vector<double> rates;  // empty: closed loop
  double duration_s = 10;
  std::uint64_t photons = 1'000'000;
  std::string csv_path;
};

/// Of a tail that says nothing: empty.
std::string Milliseconds(const LoadResult& result, const LatencyHistogram& latency,
                         double fraction) {
  const bool tail = fraction >= 0.99;
  if (latency.count() == 0 || (tail && !result.tail_is_sound())) return {};
  return fmt::format("{:.3f}", 1e-6 * static_cast<double>(latency.Percentile(fraction).count()));
}

/// The cells of one kind of requests; numbers alone, as the CSV has them.
std::vector<std::string> Row(const Options& options, double rate, const LoadResult& result,
                             RequestKind kind) {
  const KindResult& counted = result.kinds[static_cast<std::size_t>(kind)];
  const double share =
      kind == RequestKind::kBuild ? options.load.build_share : 1 - options.load.build_share;
  return {KindName(kind),
          rate > 0 ? fmt::format("{:g}", rate * share) : "",
          fmt::to_string(counted.sent),
          fmt::to_string(counted.ok),
          fmt::to_string(counted.refused),
          fmt::to_string(counted.failed),
          fmt::to_string(result.late),
          fmt::format("{:.2f}", static_cast<double>(counted.ok) / result.seconds),
          Milliseconds(result, counted.latency, 0.5),
          Milliseconds(result, counted.latency, 0.9),
          Milliseconds(result, counted.latency, 0.99),
          Milliseconds(result, counted.latency, 0.999),
          counted.ok == 0
              ? std::string()
              : fmt::format("{:.3f}", 1e-6 * static_cast<double>(counted.latency.max().count()))};
}

const std::vector<std::string> kColumns = {
    "kind",     "offered_per_s", "sent",   "ok",     "refused", "failed", "late",
    "ok_per_s", "p50_ms",        "p90_ms", "p99_ms", "p999_ms", "max_ms"};

absl::Status WriteCsv(const std::string& path, const std::vector<std::vector<std::string>>& rows) {
  auto file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  std::string text = fmt::format("{}\n", fmt::join(kColumns, ","));
  for (const auto& row : rows) text += fmt::format("{}\n", fmt::join(row, ","));
  if (auto status = file->Write(text); !status.ok()) return status;
  return file->Commit();
}

std::chrono::milliseconds TimeToLive(const Options& options) {
  const auto runs = static_cast<double>(std::max<std::size_t>(1, options.rates.size()));
  const std::chrono::duration<double> seconds(runs * options.duration_s + kSpareSeconds);
  return std::chrono::duration_cast<std::chrono::milliseconds>(seconds);
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  // What is refused is counted, not repeated.
  (*client)->SetRetryPatience({});
  const MapRef name{.name = fmt::format("load-{:08x}", std::random_device{}())};
  const auto built =
      (*client)->BuildPhotonMap(name.name, MakeLoadPhotons(options.photons, options.load.seed),
                                {.time_to_live = TimeToLive(options)});
  if (!built.ok()) return built.status();
  const MapRef map{.name = name.name, .version = built->map().version()};

  std::vector<std::vector<std::string>> rows;
  absl::Status failure;
  for (const double rate : options.rates.empty() ? std::vector<double>{0} : options.rates) {
    LoadOptions load = options.load;
    load.duration = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * options.duration_s));
    load.rate = rate;
    if (rate == 0) load.arrivals = Arrivals::kClosed;
    const LoadResult result = RunLoad(**client, map, load);
    if (!result.tail_is_sound()) {
      Warn(fmt::format(
          "at {:g} requests/s {} of {} sends were late by more than 1 ms, so there is no p99: {} "
          "workers are too few, this machine is too busy, or the server is past its capacity",
          rate, result.late, result.sent(), load.workers));
    }
    for (const RequestKind kind : {RequestKind::kGather, RequestKind::kBuild}) {
      const KindResult& counted = result.kinds[static_cast<std::size_t>(kind)];
      if (counted.sent > 0) rows.push_back(Row(options, rate, result, kind));
      failure.Update(counted.first_failure);
    }
  }
  (void)(*client)->DeletePhotonMap(map);
  fmt::print("{}", Format({.head = kColumns, .rows = rows}));
  if (!options.csv_path.empty()) {
    if (auto status = WriteCsv(options.csv_path, rows); !status.ok()) return status;
  }
  return failure;
}

}  // namespace

void AddLoadCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "load",
      "Sends gathers and builds to the server and tells how long they take. Closed loop: each "
      "worker sends the next request once the last is answered. With --rates, open loop: requests "
      "are sent when they are due, and latency counts from then");
  LoadOptions& load = options->load;
  command
      ->add_option("--rates", options->rates, "Open loop: requests/s, one run for each: 10,20,40")
      ->delimiter(',')
      ->check(NumberIn(0.01, 1e6));
  command->add_option("--arrivals", load.arrivals, "Of the open loop: poisson or constant")
      ->transform(CLI::CheckedTransformer(kOpenArrivals))
      ->default_str("poisson");
  command->add_option("--duration", options->duration_s, "Seconds of each run")
      ->check(NumberIn(0.01, 86'400))
      ->capture_default_str();
  command->add_option("--workers", load.workers, "Requests that may be under way")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
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
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
