#include <algorithm>
#include <chrono>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/answer_csv.h"
#include "client/commands/command.h"
#include "client/commands/map_option.h"
#include "client/output_file.h"
#include "client/photon_map_client.h"
#include "client/progress.h"
#include "client/query_file.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kQueriesPerCall = std::size_t{1}
                                        << 17;  // so that answers do not pile up in memory

const std::map<std::string, std::uint32_t> kOutputNames = {{"count", kOutputCount},
                                                           {"radius", kOutputRadius},
                                                           {"neighbors", kOutputNeighbors},
                                                           {"density", kOutputDensity},
                                                           {"statistics", kOutputStatistics}};
const std::map<std::string, DensityKernel> kKernelNames = {
    {"constant", DensityKernel::kConstant},
    {"cone", DensityKernel::kCone},
    {"epanechnikov", DensityKernel::kEpanechnikov}};

struct Options {
  MapRef map;
  std::string queries_path, output_path = "-";
  std::vector<std::string> outputs = {"count", "radius"};
  std::string kernel = "epanechnikov";
  GatherOptions gather;
};

// What was gathered, for the last line.
struct Summary {
  MapRef map;
  double seconds = 0;    // spent in calls to the server
  double kernel_us = 0;  // as the server measured it
};

// Gathers around all points, and writes each answer when it is there.
absl::StatusOr<Summary> GatherAll(PhotonMapClient& client, const Options& options,
                                  const QueryPoints& points, OutputFile& file) {
  if (auto status = file.Write(AnswerCsvHeader(options.gather.outputs)); !status.ok())
    return status;
  Progress progress("gather", points.size(), "queries");
  Summary summary{.map = options.map};
  for (std::size_t first = 0; first < points.size(); first += kQueriesPerCall) {
    const std::size_t count = std::min(kQueriesPerCall, points.size() - first);
    const auto began = std::chrono::steady_clock::now();
    const auto answer = client.Gather(summary.map, points.Slice(first, count), options.gather);
    summary.seconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    if (!answer.ok()) return answer.status();
    summary.map = answer->map;  // the version that answered first answers all
    summary.kernel_us += answer->timings.kernel_us();
    const auto status = file.Write(
        AnswerCsvLines(answer->result, options.gather.outputs, options.gather.k, count, first));
    if (!status.ok()) return status;
    progress.Update(first + count);
  }
  if (auto status = file.Commit(); !status.ok()) return status;
  return summary;
}

absl::Status Run(Options options, const GlobalOptions& global) {
  options.gather.outputs = 0;
  for (const std::string& output : options.outputs)
    options.gather.outputs |= kOutputNames.at(output);
  options.gather.kernel = kKernelNames.at(options.kernel);
  const auto points = ReadQueryFile(options.queries_path);
  if (!points.ok()) return points.status();
  auto file = OutputFile::Create(options.output_path);
  if (!file.ok()) return file.status();
  PhotonMapClient client(global.server, global.timeout);
  const auto summary = GatherAll(client, options, *points, *file);
  if (!summary.ok()) return summary.status();
  fmt::print(stderr, "{} queries on {}@{} in {}, kernels {}: {:.0f} queries/s\n", points->size(),
             summary->map.name, summary->map.version, FormatMicroseconds(1e6 * summary->seconds),
             FormatMicroseconds(summary->kernel_us),
             static_cast<double>(points->size()) / summary->seconds);
  return absl::OkStatus();
}

}  // namespace

void AddGatherCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("gather", "Gathers photons around the points of a file");
  AddMapOption(*command, "--map", options->map)->required();
  command
      ->add_option("--queries", options->queries_path,
                   "PLY file of x y z [nx ny nz] [r], or CSV of x,y,z[,nx,ny,nz][,r]")
      ->required();
  command
      ->add_option("--k", options->gather.k,
                   "Photons at most, the nearest; 0: all within the radius")
      ->capture_default_str()
      ->check(CLI::Range(0u, kMaxNeighbors));
  command
      ->add_option("--radius", options->gather.radius,
                   "Radius in scene units, where the file has none")
      ->capture_default_str()
      ->check(CLI::Range(0.0, std::numeric_limits<double>::infinity()));
  command
      ->add_option("--outputs", options->outputs,
                   "What to tell: count, radius, neighbors, density, statistics")
      ->delimiter(',')
      ->default_str("count,radius")
      ->check(CLI::IsMember(kOutputNames));
  command
      ->add_option("--kernel", options->kernel,
                   "Weights of the density: constant, cone, epanechnikov")
      ->capture_default_str()
      ->check(CLI::IsMember(kKernelNames));
  command->add_option("--output", options->output_path, "CSV file for the answers; - is stdout")
      ->capture_default_str();
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
