#include "client/ply_reader.h"

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <optional>
#include <system_error>

#include "client/regular_file.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kBufferSize = std::size_t{1} << 20;    // bytes
constexpr std::size_t kMaxAsciiLine = std::size_t{1} << 20;  // bytes

std::optional<double> ParseNumber(std::string_view word) {
  double value = 0;
  const char* end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

// Bytes of a row, or none where its length depends on lists.
std::optional<std::size_t> RowSize(const PlyElement& element) {
  std::size_t size = 0;
  for (const PlyProperty& property : element.properties) {
    if (property.list_count_type) return std::nullopt;
    size += PlyTypeSize(property.type);
  }
  return size;
}

bool IsNumber(const PlyProperty& property, std::string_view name) {
  return property.name == name && !property.list_count_type;
}

}  // namespace

absl::StatusOr<PlyReader> PlyReader::Open(const std::string& path) {
  PlyReader reader;
  reader.path_ = path;
  if (auto status = CheckRegularFile(path); !status.ok()) return status;
  std::error_code error;
  reader.file_size_ = std::filesystem::file_size(path, error);
  if (!error) {
    reader.stream_.open(path, std::ios::binary);
    if (!reader.stream_) error = std::error_code(errno, std::generic_category());
  }
  if (error) return absl::ErrnoToStatus(error.value(), path);

  auto header = ParsePlyHeader(reader.stream_, path);
  if (!header.ok()) return header.status();
  reader.header_ = *std::move(header);
  reader.line_ = reader.header_.line_count;
  const auto& elements = reader.header_.elements;
  const auto vertex = std::find_if(elements.begin(), elements.end(), [](const PlyElement& element) {
    return element.name == "vertex";
  });
  reader.vertex_ = static_cast<std::size_t>(vertex - elements.begin());
  if (vertex == elements.end() || !reader.Has("x") || !reader.Has("y") || !reader.Has("z")) {
    return absl::InvalidArgumentError(
        fmt::format("{}: the header has no element 'vertex' with x, y and z", path));
  }
  if (vertex->count > reader.file_size_) {
    return absl::InvalidArgumentError(
        fmt::format("{}: the file ends at byte {}, too early for {} vertices", path,
                    reader.file_size_, vertex->count));
  }
  return reader;
}

bool PlyReader::Has(std::string_view property) const {
  const auto& properties = header_.elements[vertex_].properties;
  return std::any_of(properties.begin(), properties.end(),
                     [&](const PlyProperty& candidate) { return IsNumber(candidate, property); });
}

absl::Status PlyReader::ReadVertices(std::span<const std::string_view> properties,
                                     const Visit& visit) {
  for (std::size_t i = 0; i < vertex_; ++i) {
    const std::vector<int> slots(header_.elements[i].properties.size(), -1);
    const auto status = ReadElement(header_.elements[i], slots, {}, nullptr);
    if (!status.ok()) return status;
  }
  const PlyElement& element = header_.elements[vertex_];
  std::vector<int> slots(element.properties.size(), -1);
  for (std::size_t value = 0; value < properties.size(); ++value) {
    const auto found = std::find_if(
        element.properties.begin(), element.properties.end(),
        [&](const PlyProperty& property) { return IsNumber(property, properties[value]); });
    assert(found != element.properties.end());
    slots[found - element.properties.begin()] = static_cast<int>(value);
  }
  std::vector<double> values(properties.size());
  return ReadElement(element, slots, values, &visit);
}

absl::Status PlyReader::ReadElement(const PlyElement& element, std::span<const int> slots,
                                    std::span<double> values, const Visit* visit) {
  if (element.properties.empty()) return absl::OkStatus();  // rows of nothing, however many
  if (header_.binary) buffer_.resize(kBufferSize);
  for (row_ = 0; row_ < element.count; ++row_) {
    const auto status = header_.binary ? ReadBinaryRow(element, slots, values)
                                       : ReadAsciiRow(element, slots, values);
    if (!status.ok()) return status;
    if (visit == nullptr) continue;
    if (const auto refused = (*visit)(row_, values); !refused.ok()) return refused;
  }
  return absl::OkStatus();
}

absl::Status PlyReader::ReadBinaryRow(const PlyElement& element, std::span<const int> slots,
                                      std::span<double> values) {
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    const PlyType type = property.list_count_type.value_or(property.type);
    const char* bytes = Take(PlyTypeSize(type));
    if (bytes == nullptr) return Truncated(element);
    const double number = LoadPlyNumber(type, bytes);
    if (!property.list_count_type) {
      if (slots[i] >= 0) values[slots[i]] = number;
      continue;
    }
    if (number < 0) {
      return absl::InvalidArgumentError(
          fmt::format("{}: a list of {} {} has {} numbers", path_, element.name, row_, number));
    }
    for (auto left = static_cast<std::uint64_t>(number) * PlyTypeSize(property.type); left > 0;) {
      const std::size_t size = std::min<std::uint64_t>(left, kBufferSize);
      if (Take(size) == nullptr) return Truncated(element);
      left -= size;
    }
  }
  return absl::OkStatus();
}

absl::Status PlyReader::ReadAsciiRow(const PlyElement& element, std::span<const int> slots,
                                     std::span<double> values) {
  std::optional<std::string> line;
  std::uint64_t byte_count = 0;
  do {
    line = ReadLine(stream_, kMaxAsciiLine, byte_count);
    ++line_;
    if (!line) return LineError(element, stream_.eof() ? "the file ends" : "the line is too long");
  } while (line->find_first_not_of(" \t") == line->npos);

  const auto words = SplitWords(*line);
  std::size_t word = 0;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (word >= words.size())
      return LineError(element, fmt::format("only {} numbers", words.size()));
    const auto number = ParseNumber(words[word]);
    if (!number)
      return LineError(element, fmt::format("'{}' is no number", words[word].substr(0, 40)));
    ++word;
    if (!element.properties[i].list_count_type) {
      if (slots[i] >= 0) values[slots[i]] = *number;
    } else if (*number >= 0 && *number <= static_cast<double>(words.size() - word)) {
      word += static_cast<std::size_t>(*number);
    } else {
      return LineError(element, "a list with another count of numbers than it says");
    }
  }
  if (word != words.size())
    return LineError(element, fmt::format("{} numbers, expected {}", words.size(), word));
  return absl::OkStatus();
}

const char* PlyReader::Take(std::size_t size) {
  if (buffer_last_ - buffer_first_ < size) {
    std::copy(buffer_.begin() + buffer_first_, buffer_.begin() + buffer_last_, buffer_.begin());
    buffer_last_ -= buffer_first_;
    buffer_first_ = 0;
    stream_.read(buffer_.data() + buffer_last_,
                 static_cast<std::streamsize>(buffer_.size() - buffer_last_));
    buffer_last_ += static_cast<std::size_t>(stream_.gcount());
    if (buffer_last_ < size) return nullptr;
  }
  buffer_first_ += size;
  return buffer_.data() + buffer_first_ - size;
}

absl::Status PlyReader::Truncated(const PlyElement& element) const {
  const auto row_size = RowSize(element);
  return absl::InvalidArgumentError(fmt::format(
      "{}: the file ends at byte {}, within {} {} of {}{}", path_, file_size_, element.name, row_,
      element.count, row_size ? fmt::format(" of {} bytes each", *row_size) : ""));
}

absl::Status PlyReader::LineError(const PlyElement& element, std::string_view what) const {
  return absl::InvalidArgumentError(fmt::format("{}:{}: {}, in {} {} of {}", path_, line_, what,
                                                element.name, row_, element.count));
}

absl::Status PlyReader::VertexError(std::uint64_t index, std::string_view what) const {
  return absl::InvalidArgumentError(
      header_.binary ? fmt::format("{}: vertex {}: {}", path_, index, what)
                     : fmt::format("{}:{}: vertex {}: {}", path_, line_, index, what));
}

}  // namespace treelight::client
