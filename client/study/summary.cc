#include "client/study/summary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// The 97.5 % quantile of Student's t with so many degrees of freedom, at least 1.
double StudentT(std::size_t freedom) {
  constexpr std::array<double, 30> kQuantiles = {
      12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
      2.201,  2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
      2.080,  2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042};
  return freedom <= kQuantiles.size() ? kQuantiles[freedom - 1] : 1.96;
}

using LeafAndPhotons = std::pair<PhotonSetName, std::uint32_t>;

/// What a row says relative to its baseline.
struct Ratios {
  double sah = 0, isa = 0, exact_speed = 0, knn50_speed = 0, r50_speed = 0, knn50_tests = 0,
         r50_tests = 0, leaf_fill = 0, build_ms = 0, knn50_equal = 0, r50_equal = 0;
};

double Percent(double part, double whole) { return whole > 0 ? 100 * part / whole : 0; }

/// Nodes against tests of the baseline over leaf sizes, both as logarithms, by tests.
using Curve = std::vector<std::pair<double, double>>;

/// The nodes at so many tests; empty where the curve does not reach so far.
std::optional<double> NodesAt(const Curve& curve, double tests) {
  const double x = std::log(tests);
  for (std::size_t i = 1; i < curve.size(); ++i) {
    const auto& [x0, y0] = curve[i - 1];
    const auto& [x1, y1] = curve[i];
    if (x >= x0 && x <= x1 && x1 > x0) return std::exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0));
  }
  return std::nullopt;
}

double SpeedAt(const Curve& curve, double nodes, double tests) {
  const auto baseline = NodesAt(curve, tests);
  return baseline ? Percent(*baseline, nodes) : 0;
}

/// Both curves of the baseline over one set of photons.
struct Curves {
  Curve knn50, r50;
};

std::map<PhotonSetName, Curves> BaselineCurves(std::span<const StudyRow> rows) {
  std::map<PhotonSetName, Curves> curves;
  for (const StudyRow& row : rows) {
    if (!IsBaseline(row.variant)) continue;
    Curves& of_photons = curves[row.photons];
    of_photons.knn50.emplace_back(std::log(row.searches.knn50_tests),
                                  std::log(row.searches.knn50_nodes));
    of_photons.r50.emplace_back(std::log(row.searches.r50_tests), std::log(row.searches.r50_nodes));
  }
  for (auto& [photons, of_photons] : curves) {
    std::sort(of_photons.knn50.begin(), of_photons.knn50.end());
    std::sort(of_photons.r50.begin(), of_photons.r50.end());
  }
  return curves;
}

Ratios Compare(const StudyRow& row, const StudyRow& baseline, const Curves& curves) {
  const SearchStatistics &a = row.searches, &b = baseline.searches;
  return {.sah = Percent(row.sah_cost, baseline.sah_cost),
          .isa = Percent(row.isa_cost, baseline.isa_cost),
          .exact_speed = Percent(b.exact_nodes, a.exact_nodes),
          .knn50_speed = Percent(b.knn50_nodes, a.knn50_nodes),
          .r50_speed = Percent(b.r50_nodes, a.r50_nodes),
          .knn50_tests = Percent(a.knn50_tests, b.knn50_tests),
          .r50_tests = Percent(a.r50_tests, b.r50_tests),
          .leaf_fill = row.leaf_fill,
          .build_ms = row.build_ms,
          .knn50_equal = SpeedAt(curves.knn50, a.knn50_nodes, a.knn50_tests),
          .r50_equal = SpeedAt(curves.r50, a.r50_nodes, a.r50_tests)};
}

/// The rows of one line of the summary, by seed: one for each camera.
struct Group {
  std::map<std::uint32_t, std::vector<Ratios>> by_seed;
  std::uint32_t max_depth = 0;
};

/// The estimate of one field: cameras are averaged first, so that a seed counts once. 0 where it is
/// not known of all.
Estimate EstimateOf(const Group& group, double Ratios::*field) {
  std::vector<double> means;
  for (const auto& [seed, ratios] : group.by_seed) {
    double sum = 0;
    for (const Ratios& ratio : ratios) {
      if (ratio.*field == 0) return {};
      sum += ratio.*field;
    }
    means.push_back(sum / static_cast<double>(ratios.size()));
  }
  return EstimateMean(means);
}

std::string Cell(const Estimate& estimate) {
  if (estimate.mean == 0) return "-";
  if (std::isinf(estimate.half_width)) return fmt::format("{:.1f}", estimate.mean);
  return fmt::format("{:.1f} +-{:.1f}", estimate.mean, estimate.half_width);
}

}  // namespace

Estimate EstimateMean(std::span<const double> values) {
  if (values.empty()) return {};
  const auto count = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  if (values.size() == 1) return {mean, std::numeric_limits<double>::infinity()};
  double squares = 0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  const double deviation = std::sqrt(squares / (count - 1));
  return {mean, StudentT(values.size() - 1) * deviation / std::sqrt(count)};
}

std::vector<SummaryRow> Summarise(std::span<const StudyRow> rows) {
  std::map<LeafAndPhotons, const StudyRow*> baselines;
  for (const StudyRow& row : rows) {
    if (IsBaseline(row.variant)) baselines[{row.photons, row.leaf_size}] = &row;
  }
  const auto curves = BaselineCurves(rows);
  using Kind = std::tuple<std::string, std::string, std::uint64_t, std::uint32_t, Variant>;
  std::map<Kind, Group> groups;
  std::vector<Kind> order;
  for (const StudyRow& row : rows) {
    const auto baseline = baselines.find({row.photons, row.leaf_size});
    if (baseline == baselines.end()) continue;
    const Kind kind = {row.photons.scene, row.photons.set, row.photons.photons, row.leaf_size,
                       row.variant};
    const auto [group, is_new] = groups.try_emplace(kind);
    if (is_new) order.push_back(kind);
    group->second.by_seed[row.photons.seed].push_back(
        Compare(row, *baseline->second, curves.at(row.photons)));
    group->second.max_depth = std::max(group->second.max_depth, row.depth);
  }
  std::vector<SummaryRow> summary;
  for (const Kind& kind : order) {
    const Group& group = groups.at(kind);
    const auto& [scene, set, photons, leaf_size, variant] = kind;
    summary.push_back({.scene = scene,
                       .set = set,
                       .photons = photons,
                       .leaf_size = leaf_size,
                       .variant = variant,
                       .seeds = group.by_seed.size(),
                       .sah = EstimateOf(group, &Ratios::sah),
                       .isa = EstimateOf(group, &Ratios::isa),
                       .exact_speed = EstimateOf(group, &Ratios::exact_speed),
                       .knn50_speed = EstimateOf(group, &Ratios::knn50_speed),
                       .r50_speed = EstimateOf(group, &Ratios::r50_speed),
                       .knn50_tests = EstimateOf(group, &Ratios::knn50_tests),
                       .r50_tests = EstimateOf(group, &Ratios::r50_tests),
                       .leaf_fill = EstimateOf(group, &Ratios::leaf_fill),
                       .build_ms = EstimateOf(group, &Ratios::build_ms),
                       .knn50_speed_at_equal_tests = EstimateOf(group, &Ratios::knn50_equal),
                       .r50_speed_at_equal_tests = EstimateOf(group, &Ratios::r50_equal),
                       .max_depth = group.max_depth});
  }
  return summary;
}

std::string SummaryCsv(std::span<const SummaryRow> rows) {
  const std::pair<const char*, Estimate SummaryRow::*> estimates[] = {
      {"sah_percent", &SummaryRow::sah},
      {"isa_percent", &SummaryRow::isa},
      {"exact_speed", &SummaryRow::exact_speed},
      {"knn50_speed", &SummaryRow::knn50_speed},
      {"knn50_tests_percent", &SummaryRow::knn50_tests},
      {"knn50_speed_at_equal_tests", &SummaryRow::knn50_speed_at_equal_tests},
      {"r50_speed", &SummaryRow::r50_speed},
      {"r50_tests_percent", &SummaryRow::r50_tests},
      {"r50_speed_at_equal_tests", &SummaryRow::r50_speed_at_equal_tests},
      {"leaf_fill", &SummaryRow::leaf_fill},
      {"build_ms", &SummaryRow::build_ms}};
  std::string text = "scene,set,photons,leaf_size,variant,seeds,max_depth";
  for (const auto& [name, member] : estimates) text += fmt::format(",{0},{0}_ci95", name);
  text += '\n';
  for (const SummaryRow& row : rows) {
    text += fmt::format("{},{},{},{},{},{},{}", row.scene, row.set, row.photons, row.leaf_size,
                        Label(row.variant), row.seeds, row.max_depth);
    for (const auto& [name, member] : estimates) {
      const Estimate& estimate = row.*member;
      text += fmt::format(",{:.5g},{:.3g}", estimate.mean, estimate.half_width);
    }
    text += '\n';
  }
  return text;
}

std::string SummaryTables(std::span<const SummaryRow> rows) {
  std::string text;
  for (std::size_t first = 0, last = 0; first < rows.size(); first = last) {
    const SummaryRow& head = rows[first];
    Table table{
        .head = {"tree", "SAH %", "isa %", "depth", "fill", "exact speed", "kNN 50 speed",
                 "tests %", "equal tests", "r50 speed", "tests %", "equal tests", "build ms"},
        .rows = {}};
    for (last = first; last < rows.size(); ++last) {
      const SummaryRow& row = rows[last];
      if (row.scene != head.scene || row.set != head.set || row.photons != head.photons ||
          row.leaf_size != head.leaf_size) {
        break;
      }
      table.rows.push_back(
          {Label(row.variant), Cell(row.sah), Cell(row.isa), fmt::to_string(row.max_depth),
           fmt::format("{:.2f}", row.leaf_fill.mean), Cell(row.exact_speed), Cell(row.knn50_speed),
           Cell(row.knn50_tests), Cell(row.knn50_speed_at_equal_tests), Cell(row.r50_speed),
           Cell(row.r50_tests), Cell(row.r50_speed_at_equal_tests),
           fmt::format("{:.1f}", row.build_ms.mean)});
    }
    text += fmt::format("{}{}, {} photons, {}, leaves of {}, {} seed{}\n{}",
                        text.empty() ? "" : "\n", head.scene, head.photons, head.set,
                        head.leaf_size, head.seeds, head.seeds == 1 ? "" : "s", Format(table));
  }
  return text;
}

}  // namespace treelight::client
