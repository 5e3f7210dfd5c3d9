#include "client/ply_header.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <utility>

#include "absl/status/status.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

static_assert(std::endian::native == std::endian::little,
              "binary PLY is read without swapping bytes");

constexpr std::size_t kMaxHeaderLine = 4096;  // bytes

template <typename T>
double Load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

std::optional<PlyType> ParseType(std::string_view word) {
  static constexpr std::pair<std::string_view, PlyType> kNames[] = {
      {"char", PlyType::kInt8},      {"int8", PlyType::kInt8},       {"uchar", PlyType::kUint8},
      {"uint8", PlyType::kUint8},    {"short", PlyType::kInt16},     {"int16", PlyType::kInt16},
      {"ushort", PlyType::kUint16},  {"uint16", PlyType::kUint16},   {"int", PlyType::kInt32},
      {"int32", PlyType::kInt32},    {"uint", PlyType::kUint32},     {"uint32", PlyType::kUint32},
      {"float", PlyType::kFloat32},  {"float32", PlyType::kFloat32}, {"double", PlyType::kFloat64},
      {"float64", PlyType::kFloat64}};
  for (const auto& [name, type] : kNames) {
    if (name == word) return type;
  }
  return std::nullopt;
}

// "property TYPE NAME" or "property list COUNT_TYPE TYPE NAME".
std::optional<PlyProperty> ParseProperty(const std::vector<std::string_view>& words) {
  const bool list = words.size() == 5 && words[1] == "list";
  if (!list && words.size() != 3) return std::nullopt;
  const auto type = ParseType(words[words.size() - 2]);
  if (!type) return std::nullopt;
  PlyProperty property{.name = std::string(words.back()), .type = *type, .list_count_type = {}};
  if (list) {
    property.list_count_type = ParseType(words[2]);
    if (!property.list_count_type || *property.list_count_type >= PlyType::kFloat32)
      return std::nullopt;
  }
  return property;
}

std::optional<PlyElement> ParseElement(const std::vector<std::string_view>& words) {
  if (words.size() != 3) return std::nullopt;
  PlyElement element{.name = std::string(words[1]), .count = 0, .properties = {}};
  const char* end = words[2].data() + words[2].size();
  const auto [stop, error] = std::from_chars(words[2].data(), end, element.count);
  if (error != std::errc() || stop != end) return std::nullopt;
  return element;
}

// Takes one line after the first; an empty answer is success.
std::string TakeLine(const std::vector<std::string_view>& words, bool& has_format,
                     PlyHeader& header) {
  if (words.empty() || words[0] == "comment" || words[0] == "obj_info") return {};
  if (words[0] == "format") {
    if (words.size() != 3) return "expected 'format KIND 1.0'";
    if (words[1] == "binary_big_endian")
      return "big-endian files are not read, save it as binary_little_endian";
    if (words[1] != "ascii" && words[1] != "binary_little_endian")
      return fmt::format("unknown format '{}'", words[1]);
    header.binary = words[1] == "binary_little_endian";
    has_format = true;
    return {};
  }
  if (words[0] == "element") {
    const auto element = ParseElement(words);
    if (!element) return "expected 'element NAME COUNT'";
    header.elements.push_back(*element);
    return {};
  }
  if (words[0] == "property") {
    if (header.elements.empty()) return "a property before the first element";
    const auto property = ParseProperty(words);
    if (!property) return "expected 'property TYPE NAME' or 'property list TYPE TYPE NAME'";
    header.elements.back().properties.push_back(*property);
    return {};
  }
  return "not a line of a PLY header";
}

}  // namespace

std::size_t PlyTypeSize(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

double LoadPlyNumber(PlyType type, const char* bytes) {
  switch (type) {
    case PlyType::kInt8:
      return Load<std::int8_t>(bytes);
    case PlyType::kUint8:
      return Load<std::uint8_t>(bytes);
    case PlyType::kInt16:
      return Load<std::int16_t>(bytes);
    case PlyType::kUint16:
      return Load<std::uint16_t>(bytes);
    case PlyType::kInt32:
      return Load<std::int32_t>(bytes);
    case PlyType::kUint32:
      return Load<std::uint32_t>(bytes);
    case PlyType::kFloat32:
      return Load<float>(bytes);
    case PlyType::kFloat64:
      return Load<double>(bytes);
  }
  return 0;
}

std::optional<std::string> ReadLine(std::istream& stream, std::size_t max_size,
                                    std::uint64_t& byte_count) {
  std::string line;
  for (int c = stream.get(); c != std::istream::traits_type::eof(); c = stream.get()) {
    ++byte_count;
    if (c == '\n') {
      if (line.ends_with('\r')) line.pop_back();
      return line;
    }
    if (line.size() == max_size) return std::nullopt;
    line.push_back(static_cast<char>(c));
  }
  if (line.empty()) return std::nullopt;
  return line;
}

std::vector<std::string_view> SplitWords(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t first = line.find_first_not_of(" \t"); first != line.npos;
       first = line.find_first_not_of(" \t", first)) {
    const std::size_t last = std::min(line.find_first_of(" \t", first), line.size());
    words.push_back(line.substr(first, last - first));
    first = last;
  }
  return words;
}

absl::StatusOr<PlyHeader> ParsePlyHeader(std::istream& stream, const std::string& path) {
  PlyHeader header;
  bool has_format = false;
  for (;;) {
    const auto line = ReadLine(stream, kMaxHeaderLine, header.byte_count);
    ++header.line_count;
    if (header.line_count == 1) {
      if (line == "ply") continue;
      return absl::InvalidArgumentError(
          fmt::format("{}: no PLY file, its first line is not 'ply'", path));
    }
    std::string error = line ? std::string() : "the header has no end_header";
    if (line && *line == "end_header") {
      if (has_format) return header;
      error = "the header has no format";
    } else if (line) {
      error = TakeLine(SplitWords(*line), has_format, header);
    }
    if (!error.empty()) {
      return absl::InvalidArgumentError(fmt::format("{}:{}: {}", path, header.line_count, error));
    }
  }
}

}  // namespace treelight::client
