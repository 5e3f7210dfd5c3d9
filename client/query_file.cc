#include "client/query_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <optional>
#include <span>
#include <string_view>

#include "absl/status/status.h"
#include "client/ply_reader.h"
#include "client/regular_file.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kMaxLineSize = 4096;                   // bytes
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";  // spreadsheets put it first

// Numbers that a point may have, and their names in a file.
enum Field { kX, kY, kZ, kNormalX, kNormalY, kNormalZ, kRadius, kFieldCount };
constexpr std::array<std::string_view, kFieldCount> kFieldNames = {"x",  "y",  "z", "nx",
                                                                   "ny", "nz", "r"};

using Fields = std::vector<Field>;  // of the columns, in order

bool Contains(const Fields& fields, Field field) {
  return std::find(fields.begin(), fields.end(), field) != fields.end();
}

// What is wrong with a file that has these columns; empty where nothing is.
std::string CheckFields(const Fields& fields) {
  for (int field = 0; field < kFieldCount; ++field) {
    if (std::count(fields.begin(), fields.end(), field) > 1)
      return fmt::format("two columns {}", kFieldNames[field]);
    const bool needed = field <= kZ || (field <= kNormalZ && Contains(fields, kNormalX));
    if (needed && !Contains(fields, Field(field)))
      return fmt::format("no column {}", kFieldNames[field]);
  }
  if (!Contains(fields, kNormalX) && (Contains(fields, kNormalY) || Contains(fields, kNormalZ)))
    return "no column nx";
  return {};
}

// Appends one point; an answer that is not empty says what is wrong with it.
std::string AppendPoint(const Fields& fields, std::span<const double> values, QueryPoints& points) {
  std::array<float, kFieldCount> point{};
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const Field field = fields[i];
    const double value = values[i];
    const double limit = field <= kZ ? kMaxCoordinate : std::numeric_limits<float>::max();
    const bool good = field == kRadius ? value >= 0 && (value <= limit || std::isinf(value))
                                       : std::fabs(value) <= limit;
    if (!good) {
      return fmt::format("{} is {}, it must be {}", kFieldNames[field], value,
                         field == kRadius ? "a float32 >= 0 or inf"
                                          : fmt::format("finite and within {:g}", limit));
    }
    point[field] = static_cast<float>(value);
  }
  points.positions.insert(points.positions.end(), point.begin(), point.begin() + 3);
  if (Contains(fields, kNormalX)) {
    points.normals.insert(points.normals.end(), point.begin() + kNormalX, point.begin() + kRadius);
  }
  if (Contains(fields, kRadius)) points.radii.push_back(point[kRadius]);
  return {};
}

absl::StatusOr<QueryPoints> ReadPly(const std::string& path) {
  auto reader = PlyReader::Open(path);
  if (!reader.ok()) return reader.status();
  std::vector<std::string_view> properties;
  Fields fields;
  for (int field = 0; field < kFieldCount; ++field) {
    const std::string_view name =
        field == kRadius && !reader->Has("r") ? "radius" : kFieldNames[field];
    if (!reader->Has(name)) continue;
    properties.push_back(name);
    fields.push_back(Field(field));
  }
  if (const auto error = CheckFields(fields); !error.empty()) {
    return absl::InvalidArgumentError(fmt::format("{}: {}", path, error));
  }
  QueryPoints points;
  const auto status =
      reader->ReadVertices(properties, [&](std::uint64_t i, std::span<const double> values) {
        const auto error = AppendPoint(fields, values, points);
        return error.empty() ? absl::OkStatus() : reader->VertexError(i, error);
      });
  if (!status.ok()) return status;
  return points;
}

std::vector<std::string_view> SplitColumns(std::string_view line) {
  std::vector<std::string_view> columns;
  for (std::size_t first = 0;;) {
    const std::size_t comma = std::min(line.find(',', first), line.size());
    std::string_view column = line.substr(first, comma - first);
    column.remove_prefix(std::min(column.find_first_not_of(" \t"), column.size()));
    column = column.substr(0, column.find_last_not_of(" \t") + 1);
    columns.push_back(column);
    if (comma == line.size()) return columns;
    first = comma + 1;
  }
}

std::optional<double> ParseNumber(std::string_view text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

// The columns that a line of names declares, and what is wrong with it.
std::string ParseNames(const std::vector<std::string_view>& columns, Fields& fields) {
  for (const std::string_view column : columns) {
    const auto name = std::find(kFieldNames.begin(), kFieldNames.end(), column);
    if (name == kFieldNames.end()) {
      return fmt::format("'{}' is neither a number nor a column of x, y, z, nx, ny, nz, r",
                         column.substr(0, 40));
    }
    fields.push_back(Field(name - kFieldNames.begin()));
  }
  return CheckFields(fields);
}

// The columns of a file without names; empty where their number is wrong.
Fields DefaultFields(std::size_t column_count) {
  switch (column_count) {
    case 3:
      return {kX, kY, kZ};
    case 4:
      return {kX, kY, kZ, kRadius};
    case 6:
      return {kX, kY, kZ, kNormalX, kNormalY, kNormalZ};
    case 7:
      return {kX, kY, kZ, kNormalX, kNormalY, kNormalZ, kRadius};
    default:
      return {};
  }
}

// Takes one line of CSV that is neither empty nor a comment; an answer that is not empty says what
// is wrong.
std::string TakeLine(std::string_view line, Fields& fields, QueryPoints& points) {
  const auto columns = SplitColumns(line);
  if (fields.empty()) {
    if (!ParseNumber(columns[0])) return ParseNames(columns, fields);
    fields = DefaultFields(columns.size());
    if (fields.empty())
      return fmt::format("{} columns without names, expected 3, 4, 6 or 7", columns.size());
  }
  if (columns.size() != fields.size())
    return fmt::format("{} columns, expected {}", columns.size(), fields.size());
  std::array<double, kFieldCount> values{};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto value = ParseNumber(columns[i]);
    if (!value) return fmt::format("column {} is '{}', no number", i + 1, columns[i].substr(0, 40));
    values[i] = *value;
  }
  return AppendPoint(fields, std::span(values).first(columns.size()), points);
}

absl::StatusOr<QueryPoints> ReadCsv(std::istream& stream, const std::string& path) {
  QueryPoints points;
  Fields fields;
  std::uint64_t byte_count = 0;
  for (std::uint64_t line_number = 1; stream.peek() != std::istream::traits_type::eof();
       ++line_number) {
    auto line = ReadLine(stream, kMaxLineSize, byte_count);
    if (line && line_number == 1 && line->starts_with(kByteOrderMark))
      line->erase(0, kByteOrderMark.size());
    std::string error;
    if (!line) {
      error = fmt::format("the line is longer than {} bytes", kMaxLineSize);
    } else if (line->find_first_not_of(" \t") != line->npos && !line->starts_with('#')) {
      error = TakeLine(*line, fields, points);
    }
    if (!error.empty())
      return absl::InvalidArgumentError(fmt::format("{}:{}: {}", path, line_number, error));
  }
  return points;
}

}  // namespace

GatherQueries QueryPoints::Slice(std::size_t first, std::size_t count) const {
  GatherQueries queries{
      .positions = std::span(positions).subspan(3 * first, 3 * count), .normals = {}, .radii = {}};
  if (!normals.empty()) queries.normals = std::span(normals).subspan(3 * first, 3 * count);
  if (!radii.empty()) queries.radii = std::span(radii).subspan(first, count);
  return queries;
}

absl::StatusOr<QueryPoints> ReadQueryFile(const std::string& path) {
  if (auto status = CheckRegularFile(path); !status.ok()) return status;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return absl::ErrnoToStatus(errno, path);

  std::uint64_t byte_count = 0;
  const bool ply = ReadLine(stream, kMaxLineSize, byte_count) == "ply";
  stream.clear();
  stream.seekg(0);
  auto points = ply ? ReadPly(path) : ReadCsv(stream, path);
  if (points.ok() && points->size() == 0) {
    return absl::InvalidArgumentError(fmt::format("{}: it has no points", path));
  }
  return points;
}

}  // namespace treelight::client
