#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/answer_csv.h"
#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/map_option.h"
#include "client/commands/output_names.h"
#include "client/commands/server_option.h"
#include "client/gather_wire.h"
#include "client/output_file.h"
#include "client/photon_map_client.h"
#include "client/progress.h"
#include "client/query_file.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

// What one call asks for, so that answers of any size pass through little memory.
constexpr std::size_t kMaxQueriesPerCall = std::size_t{1} << 17;
constexpr std::size_t kNeighborsPerCall = std::size_t{1} << 23;  // aimed at
constexpr std::size_t kFirstUncappedQueries = 256;  // of lists whose lengths are not known yet

const std::map<std::string, DensityKernel> kKernelNames = {
    {"constant", DensityKernel::kConstant},
    {"cone", DensityKernel::kCone},
    {"epanechnikov", DensityKernel::kEpanechnikov}};

struct Options {
  MapRef map;
  std::string queries_path, output_path = "-";
  std::vector<std::string> outputs = {"count", "radius"};
  std::string kernel = "epanechnikov";
  GatherOptions gather{.k = 50};
  WireOptions wire{};
  bool half_answers = false;
};

// Why calls were answered exactly.
std::string_view ReasonText(v1::ExactReason reason) {
  switch (reason) {
    case v1::EXACT_REASON_FEW_QUERIES:
      return "since they are of few queries";
    case v1::EXACT_REASON_FEW_PHOTONS:
      return "since queries find few photons";
    case v1::EXACT_REASON_ERROR_TOO_BIG:
      return "since the error would be larger";
    case v1::EXACT_REASON_NO_MEMORY:
      return "since the server has no memory for another map";
    default:
      return "for a reason that this program does not know";
  }
}

// What was gathered, for the last lines.
struct Summary {
  MapRef map;
  double seconds = 0;    // spent in calls to the server
  double kernel_us = 0;  // as the server measured it
  ErrorSummary errors{};
  WireSummary wire{};
  std::vector<v1::MergeReport> merge_reports{};  // of the calls
  std::string search{};
};

// Queries of the first call.
std::size_t FirstCount(const GatherOptions& options) {
  if ((options.outputs & kOutputNeighbors) == 0) return kMaxQueriesPerCall;
  if (options.k == 0) return kFirstUncappedQueries;
  return std::clamp<std::size_t>(kNeighborsPerCall / options.k, 1, kMaxQueriesPerCall);
}

// Queries of the call after one of `count` queries: as many as would have had kNeighborsPerCall
// neighbours.
std::size_t NextCount(const GatherOptions& options, std::size_t count, const GatherResult& result) {
  if ((options.outputs & kOutputNeighbors) == 0 || options.k > 0) return count;
  return std::clamp<std::size_t>(count * kNeighborsPerCall / (result.neighbor_ids.size() + 1), 1,
                                 std::min(8 * count, kMaxQueriesPerCall));
}

// Says which points of the file an error is about, where a call did not begin with the first.
absl::Status InFile(const absl::Status& status, std::size_t first) {
  if (first == 0) return status;
  return {status.code(),
          fmt::format("{} (of the queries from {} on)", std::string(status.message()), first)};
}

// Gathers around all points, and writes each answer when it is there.
absl::StatusOr<Summary> GatherAll(PhotonMapClient& client, const Options& options,
                                  const QueryPoints& points, OutputFile& file) {
  Progress progress("gather", points.size(), "queries");
  Summary summary{.map = options.map};
  std::size_t call_count = FirstCount(options.gather);
  for (std::size_t first = 0, count = 0; first < points.size(); first += count) {
    count = std::min(call_count, points.size() - first);
    const auto began = std::chrono::steady_clock::now();
    const auto answer =
        client.Gather(summary.map, points.Slice(first, count), options.gather, options.wire);
    summary.seconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    if (!answer.ok()) return InFile(answer.status(), first);
    summary.map = answer->map;  // the version that answered first answers all
    summary.kernel_us += answer->timings.kernel_us();
    summary.errors.inexact_count += answer->errors.inexact_count;
    AppendWire(answer->wire, summary.wire);
    summary.merge_reports.push_back(answer->merge_report);
    summary.search = answer->search;
    summary.errors.largest_bound =
        std::max(summary.errors.largest_bound, answer->errors.largest_bound);
    std::string lines = first == 0 ? AnswerCsvHeader(options.gather.outputs) : "";
    lines += AnswerCsvLines(answer->result, options.gather.outputs, options.gather.k, count, first);
    const auto status = file.Write(lines);
    if (!status.ok()) return status;
    progress.Update(first + count);
    call_count = NextCount(options.gather, count, answer->result);
  }
  if (auto status = file.Commit(); !status.ok()) return status;
  return summary;
}

// What was chosen for the calls, those with one choice together.
void PrintMerged(const Summary& summary) {
  struct Told {
    std::size_t calls = 0;
    std::uint64_t sampled = 0;  // queries
    float error = 0;            // the largest that was measured
  };
  std::map<std::string, Told> choices;
  for (const v1::MergeReport& report : summary.merge_reports) {
    const std::string choice =
        report.merged_photons() > 0
            ? fmt::format("up to {} photons merged to one", report.merged_photons())
        : report.thinned_photons() > 0
            ? fmt::format("one of {} photons", report.thinned_photons())
            : fmt::format("exact, {}{}", ReasonText(report.exact_reason()),
                          report.whole_subtrees() ? "; whole subtrees added up" : "");
    Told& told = choices[choice];
    ++told.calls;
    told.sampled += report.sampled_queries();
    told.error = std::max(told.error, report.measured_error());
  }
  for (const auto& [choice, told] : choices) {
    const std::string error = told.sampled > 0
                                  ? fmt::format("; density off by {:.2g} in a sample of {} queries",
                                                told.error, told.sampled)
                                  : "";
    fmt::print(stderr, "{} of {} calls: {}{}\n", told.calls, summary.merge_reports.size(), choice,
               error);
  }
}

// What travelled, and what that took.
void PrintWire(const WireSummary& wire, std::size_t query_count) {
  const auto per_query = [&](std::uint64_t bytes) {
    return static_cast<double>(bytes) / static_cast<double>(query_count);
  };
  fmt::print(stderr, "wire: {:.1f} bytes a query there, {:.1f} back", per_query(wire.request_bytes),
             per_query(wire.answer_bytes));
  if (wire.largest_move > 0) fmt::print(stderr, "; queries moved by {:.2g}", wire.largest_move);
  if (wire.relative_error > 0) {
    fmt::print(stderr, "; numbers off by {:.2g} of themselves, {} too small for that",
               wire.relative_error, wire.small_count);
  }
  fmt::print(stderr, "\n");
}

absl::Status Run(Options options, const GlobalOptions& global) {
  if (options.half_answers) options.wire.answer_floats = v1::FLOAT_FORMAT_HALF;
  options.gather.outputs = OutputMask(options.outputs);
  options.gather.kernel = kKernelNames.at(options.kernel);
  const auto points = ReadQueryFile(options.queries_path);
  if (!points.ok()) return points.status();
  if (options.gather.k == 0 && std::isinf(options.gather.radius) && points->radii.empty()) {
    throw CLI::ValidationError("--k", "0 asks for all photons within a radius: give --radius");
  }
  auto file = OutputFile::Create(options.output_path);
  if (!file.ok()) return file.status();
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto summary = GatherAll(**client, options, *points, *file);
  if (!summary.ok()) return summary.status();
  fmt::print(stderr, "{} queries on {}@{} in {}, kernels {}: {:.0f} queries/s\n", points->size(),
             summary->map.name, summary->map.version, FormatMicroseconds(1e6 * summary->seconds),
             FormatMicroseconds(summary->kernel_us),
             static_cast<double>(points->size()) / summary->seconds);
  fmt::print(stderr, "search: {}\n", summary->search);
  if (options.gather.approximation.any()) {
    const ErrorSummary& errors = summary->errors;
    fmt::print(stderr, "approximate: {} of {} queries may err; {} at most {:.3g}\n",
               errors.inexact_count, points->size(),
               options.gather.k > 0 ? "distances are 1 + e times the true ones, e"
                                    : "densities by W / unit^2",
               errors.largest_bound);
  }
  if (options.gather.approximation.merges()) PrintMerged(*summary);
  if (options.wire.quantize_queries || options.half_answers) {
    PrintWire(summary->wire, points->size());
  }
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
      ->check(NumberIn(0, std::numeric_limits<double>::infinity()));
  command
      ->add_option("--outputs", options->outputs,
                   "What to tell: count, radius, neighbors, density, statistics, "
                   "error-bound")
      ->delimiter(',')
      ->default_str("count,radius")
      ->check(CLI::IsMember(OutputNames()));
  command
      ->add_option("--kernel", options->kernel,
                   "Weights of the density: constant, cone, epanechnikov")
      ->capture_default_str()
      ->check(CLI::IsMember(kKernelNames));
  command
      ->add_option("--epsilon", options->gather.approximation.epsilon,
                   "Distances may be 1 + this times the true ones; 0: exact")
      ->capture_default_str()
      ->check(NumberIn(0, std::numeric_limits<float>::max()));
  command
      ->add_option("--max-leaves", options->gather.approximation.max_leaves,
                   "Leaves of the tree that a search looks into at most; 0: no limit")
      ->capture_default_str();
  command
      ->add_option("--weight-tolerance", options->gather.approximation.weight_tolerance,
                   "With --k 0: whole subtrees are added up at once where no weight changes by "
                   "more than this part of the largest; 0: photon by photon")
      ->capture_default_str()
      ->check(NumberIn(0, 1));
  command
      ->add_option("--merged-photons", options->gather.approximation.merged_photons,
                   "Densities from a map in which up to so many photons, 2, 4, 8 ... 64, are "
                   "merged to one; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(0u, kMaxMergedPhotons));
  command
      ->add_option("--thinned-photons", options->gather.approximation.thinned_photons,
                   "The same from a random subset, one photon of so many; 0: all")
      ->capture_default_str()
      ->check(CLI::Range(0u, kMaxMergedPhotons));
  command
      ->add_option("--max-relative-error", options->gather.approximation.max_relative_error,
                   "Densities as merged photons give them within this error, root mean square "
                   "relative to the exact ones, by a sample; 0: exact")
      ->capture_default_str()
      ->check(NumberIn(0, 1));
  command->add_flag("--quantize-queries", options->wire.quantize_queries,
                    "Sends points as 16-bit offsets in their box, normals as two 16-bit numbers");
  command->add_flag(
      "--half-answers", options->half_answers,
      "Radii, distances and densities come as half floats, off by 2^-11 of themselves");
  command->add_option("--output", options->output_path, "CSV file for the answers; - is stdout")
      ->capture_default_str();
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
