#include "client/table.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "fmt/format.h"

namespace treelight::client {
namespace {

bool IsNumber(const std::string& cell) {
  return !cell.empty() &&
         (std::isdigit(static_cast<unsigned char>(cell[0])) || cell[0] == '-' || cell[0] == '+');
}

std::string FormatLine(const std::vector<std::string>& cells,
                       const std::vector<std::size_t>& widths, const std::vector<bool>& right) {
  std::string line;
  for (std::size_t column = 0; column < cells.size(); ++column) {
    if (column > 0) line += "  ";
    line += right[column] ? fmt::format("{:>{}}", cells[column], widths[column])
                          : fmt::format("{:<{}}", cells[column], widths[column]);
  }
  line.erase(line.find_last_not_of(' ') + 1);
  return line + "\n";
}

}  // namespace

std::string Format(const Table& table) {
  const std::size_t column_count = !table.head.empty()  ? table.head.size()
                                   : table.rows.empty() ? 0
                                                        : table.rows[0].size();
  std::vector<std::size_t> widths(column_count, 0);
  std::vector<bool> right(column_count, !table.rows.empty());
  for (std::size_t column = 0; column < column_count; ++column) {
    if (!table.head.empty()) widths[column] = table.head[column].size();
    for (const auto& row : table.rows) {
      widths[column] = std::max(widths[column], row[column].size());
      right[column] = right[column] && IsNumber(row[column]);
    }
  }
  std::string text = table.head.empty() ? "" : FormatLine(table.head, widths, right);
  for (const auto& row : table.rows) text += FormatLine(row, widths, right);
  return text;
}

std::string FormatBytes(double bytes) {
  static constexpr std::array<const char*, 5> kUnits = {"B", "KiB", "MiB", "GiB", "TiB"};
  std::size_t unit = 0;
  for (; bytes >= 1024 && unit + 1 < kUnits.size(); ++unit) bytes /= 1024;
  return unit == 0 ? fmt::format("{:.0f} B", bytes) : fmt::format("{:.1f} {}", bytes, kUnits[unit]);
}

std::string FormatMicroseconds(double microseconds) {
  return microseconds < 1e6 ? fmt::format("{:.2f} ms", microseconds / 1e3)
                            : fmt::format("{:.2f} s", microseconds / 1e6);
}

}  // namespace treelight::client
