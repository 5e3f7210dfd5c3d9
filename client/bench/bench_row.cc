#include "client/bench/bench_row.h"

#include <algorithm>
#include <array>
#include <type_traits>

#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

template <typename T>
std::string Cell(const T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    return value ? "1" : "0";
  } else if constexpr (std::is_floating_point_v<T>) {
    return fmt::format("{:.6g}", value);
  } else {
    return fmt::to_string(value);
  }
}

/// Names of processors and devices, without what would end a cell.
std::string Cell(const std::string& text) {
  std::string cell = text;
  std::ranges::replace_if(
      cell, [](char c) { return c == ',' || c == '"' || c == '\n' || c == '\r'; }, ' ');
  return cell;
}

/// Calls `visit(name, value)` for each column, in order.
template <typename Visit>
void ForEachColumn(const BenchRow& row, Visit visit) {
  visit("figure", row.figure);
  visit("name", row.name);
  visit("set", row.set);
  visit("seed", row.seed);
  visit("fresh", row.fresh);
  visit("photons", row.photons);
  visit("builder", row.builder);
  visit("leaf_size", row.leaf_size);
  visit("k", row.k);
  visit("radius", row.radius);
  visit("answers", row.answers);
  visit("order", row.order);
  visit("queries", row.queries);
  visit("threads", row.threads);
  visit("repetitions", row.repetitions);
  visit("device_min_ms", row.device.min_ms);
  visit("device_median_ms", row.device.median_ms);
  visit("device_max_ms", row.device.max_ms);
  const auto wall = [&](double Spread::*part) {
    return row.wall ? Cell((*row.wall).*part) : std::string();
  };
  visit("wall_min_ms", wall(&Spread::min_ms));
  visit("wall_median_ms", wall(&Spread::median_ms));
  visit("wall_max_ms", wall(&Spread::max_ms));
  visit("per_second", row.per_second);
  visit("checked", row.checked);
  visit("machine", row.machine);
  visit("device", row.device_name);
}

std::string Times(const Spread& spread) {
  return fmt::format("{:.4g} ({:.4g} to {:.4g})", spread.median_ms, spread.min_ms, spread.max_ms);
}

std::string Rate(double per_second) {
  return per_second < 1e9 ? fmt::format("{:.3g} M/s", 1e-6 * per_second)
                          : fmt::format("{:.3g} G/s", 1e-9 * per_second);
}

}  // namespace

Spread MakeSpread(std::vector<double> times_ms) {
  std::ranges::sort(times_ms);
  const std::size_t count = times_ms.size();
  return {times_ms.front(), (times_ms[(count - 1) / 2] + times_ms[count / 2]) / 2, times_ms.back()};
}

std::string BenchCsvHeader() {
  std::vector<std::string> names;
  ForEachColumn({}, [&](const char* name, const auto&) { names.emplace_back(name); });
  return fmt::format("{}\n", fmt::join(names, ","));
}

std::string BenchCsvLine(const BenchRow& row) {
  std::vector<std::string> cells;
  ForEachColumn(row, [&](const char*, const auto& value) { cells.push_back(Cell(value)); });
  return fmt::format("{}\n", fmt::join(cells, ","));
}

std::string BenchTable(const std::vector<BenchRow>& rows) {
  Table table{.head = {"", "set", "seed", "photons", "tree", "order", "threads", "device ms",
                       "wall ms", "rate"},
              .rows = {}};
  for (const BenchRow& row : rows) {
    if (row.figure == "stage") continue;
    table.rows.push_back(
        {row.figure == "gather" ? row.name : row.figure + " " + row.name, row.set,
         fmt::format("{}{}", row.seed, row.fresh ? " (fresh)" : ""), fmt::to_string(row.photons),
         row.builder.empty() ? "" : fmt::format("{} ({})", row.builder, row.leaf_size), row.order,
         row.threads == 0 ? "" : fmt::to_string(row.threads), Times(row.device),
         row.wall ? Times(*row.wall) : "", Rate(row.per_second)});
  }
  return Format(table);
}

}  // namespace treelight::client
