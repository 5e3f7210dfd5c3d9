#include "client/load/load_table.h"

#include <filesystem>
#include <system_error>

#include "client/chart_script.h"
#include "client/load/charts_script.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

/// Of a tail that says nothing, for late sends or too few answers: empty.
std::string Milliseconds(const LoadResult& result, const LatencyHistogram& latency,
                         double fraction) {
  constexpr double kRoundings = 1e-9;
  const double above = (1 - fraction) * static_cast<double>(latency.count());
  const bool few = above < 1 - kRoundings;
  const bool tail = fraction >= 0.99;
  if (latency.count() == 0 || (tail && (few || !result.IsSound(fraction)))) return {};
  return fmt::format("{:.3f}", 1e-6 * static_cast<double>(latency.Percentile(fraction).count()));
}

std::vector<std::string> Row(const LoadRun& run, RequestKind kind) {
  const LoadResult& result = run.result;
  const KindResult& counted = result.kinds[static_cast<std::size_t>(kind)];
  const bool closed = run.options.arrivals == Arrivals::kClosed;
  return {
      KindName(kind),
      fmt::format("{}{}", closed ? "closed" : "open", result.interrupted ? " (interrupted)" : ""),
      run.share > 0 ? fmt::format("{:g}", run.share) : "",
      closed ? "" : fmt::format("{:g}", run.options.rate),
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

}  // namespace

const std::vector<std::string>& LoadColumns() {
  static const std::vector<std::string> columns = {
      "kind", "loop",     "share",  "offered_per_s", "sent",   "ok",      "refused", "failed",
      "late", "ok_per_s", "p50_ms", "p90_ms",        "p99_ms", "p999_ms", "max_ms"};
  return columns;
}

std::vector<std::vector<std::string>> LoadRows(const std::vector<LoadRun>& runs) {
  std::vector<std::vector<std::string>> rows;
  for (const LoadRun& run : runs) {
    for (const RequestKind kind : {RequestKind::kGather, RequestKind::kBuild}) {
      if (run.result.kinds[static_cast<std::size_t>(kind)].sent > 0) rows.push_back(Row(run, kind));
    }
  }
  return rows;
}

absl::Status WriteLoadCsv(OutputFile& file, const std::vector<LoadRun>& runs) {
  std::string text = fmt::format("{}\n", fmt::join(LoadColumns(), ","));
  for (const auto& row : LoadRows(runs)) text += fmt::format("{}\n", fmt::join(row, ","));
  if (auto status = file.Write(text); !status.ok()) return status;
  return file.Commit();
}

absl::Status DrawLoadCharts(const std::vector<std::string>& csv_paths, const std::string& folder) {
  for (const std::string& path : csv_paths) {
    if (std::error_code error; !std::filesystem::exists(path, error)) {
      return absl::NotFoundError(fmt::format(
          "{}: {}", path, error ? error.message() : std::string("there is no such file")));
    }
  }
  return RunChartScript(kLoadCharts, csv_paths, folder);
}

}  // namespace treelight::client
