#include "client/study/study_row.h"

#include <charconv>
#include <type_traits>
#include <utility>

#include "fmt/format.h"

namespace treelight::client {
namespace {

/// Calls `visit(name, field)` for each column of `row`, in order.
template <typename Row, typename Visit>
void ForEachColumn(Row& row, Visit visit) {
  visit("scene", row.photons.scene);
  visit("set", row.photons.set);
  visit("seed", row.photons.seed);
  visit("photons", row.photons.photons);
  visit("builder", row.variant.builder);
  visit("heuristic", row.variant.heuristic);
  visit("treelet_size", row.variant.treelet_size);
  visit("rounds", row.variant.rounds);
  visit("leaf_size", row.leaf_size);
  visit("sah_cost", row.sah_cost);
  visit("isa_cost", row.isa_cost);
  visit("depth", row.depth);
  visit("leaf_fill", row.leaf_fill);
  visit("exact_nodes", row.searches.exact_nodes);
  visit("knn50_nodes", row.searches.knn50_nodes);
  visit("knn50_tests", row.searches.knn50_tests);
  visit("r50_nodes", row.searches.r50_nodes);
  visit("r50_tests", row.searches.r50_tests);
  visit("build_ms", row.build_ms);
  visit("device", row.device);
  visit("leaf_term", row.variant.leaf_term);
  visit("subtree_size", row.variant.subtree_size);
  visit("camera", row.photons.camera);
  visit("knn50_ns", row.knn50_ns);
  visit("r50_ns", row.r50_ns);
}

/// The cells of a line; quotes are not known, since nothing that is written needs them.
std::vector<std::string_view> Cells(std::string_view line) {
  std::vector<std::string_view> cells;
  while (true) {
    const std::size_t comma = std::min(line.find(','), line.size());
    cells.push_back(line.substr(0, comma));
    if (comma == line.size()) return cells;
    line.remove_prefix(comma + 1);
  }
}

/// A device's name in a cell: without what would end the cell.
std::string Clean(std::string text) {
  for (char& c : text) {
    if (c == ',' || c == '"' || c == '\n' || c == '\r') c = ' ';
  }
  return text;
}

template <typename T>
bool Parse(std::string_view cell, T& value) {
  if constexpr (std::is_same_v<T, std::string>) {
    value = cell;
    return true;
  } else {
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    return error == std::errc() && end == cell.data() + cell.size();
  }
}

}  // namespace

std::string StudyCsvHeader() {
  std::string line;
  StudyRow row;
  ForEachColumn(row, [&](const char* name, const auto&) {
    line += line.empty() ? name : fmt::format(",{}", name);
  });
  return line + "\n";
}

std::string StudyCsvLine(const StudyRow& row) {
  std::string line;
  ForEachColumn(row, [&](const char*, const auto& value) {
    using T = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<T, std::string>) {
      line += Clean(value);
    } else if constexpr (std::is_same_v<T, double>) {
      line += fmt::format("{:.6g}", value);
    } else {
      line += fmt::to_string(value);
    }
    line += ',';
  });
  line.back() = '\n';
  return line;
}

absl::StatusOr<std::vector<StudyRow>> ParseStudyCsv(std::string_view text,
                                                    const std::string& path) {
  std::vector<StudyRow> rows;
  const std::string header = StudyCsvHeader();
  if (!text.starts_with(header)) {
    return absl::InvalidArgumentError(fmt::format("{}:1: the columns are not those of a study: {}",
                                                  path, header.substr(0, header.size() - 1)));
  }
  text.remove_prefix(header.size());
  for (std::size_t line_number = 2; !text.empty(); ++line_number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const auto cells = Cells(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    StudyRow row;
    std::size_t column = 0;
    absl::Status status;
    ForEachColumn(row, [&](const char* name, auto& value) {
      const std::size_t i = column++;
      if (!status.ok() || (i < cells.size() && Parse(cells[i], value))) return;
      status = absl::InvalidArgumentError(
          i < cells.size()
              ? fmt::format("{}:{}: {} is '{}', no number", path, line_number, name, cells[i])
              : fmt::format("{}:{}: the line ends before {}", path, line_number, name));
    });
    if (!status.ok()) return status;
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace treelight::client
