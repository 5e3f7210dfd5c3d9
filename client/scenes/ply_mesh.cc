#include "client/scenes/ply_mesh.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <vector>

#include "absl/status/status.h"
#include "client/ply_header.h"
#include "client/scenes/mesh_file.h"
#include "core/model/photons.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kMaxHeader = 1 << 16;  // bytes
constexpr std::array<std::string_view, 6> kVertexNames = {"x", "y", "z", "nx", "ny", "nz"};

absl::Status Invalid(const std::string& message) { return absl::InvalidArgumentError(message); }

/// The numbers behind the header, one after the other.
class Numbers {
 public:
  Numbers(std::string_view bytes, const PlyHeader& header, const std::string& path)
      : binary_(header.binary),
        path_(path),
        bytes_(bytes),
        at_(header.byte_count),
        line_(header.line_count) {}

  /// Begins a row: in ASCII the next line that is not blank.
  void BeginRow() {
    if (binary_) return;
    row_ = {};
    while (at_ < bytes_.size() && SkipBlanks(row_).empty()) {
      const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
      row_ = bytes_.substr(at_, end - at_);
      at_ = std::min(end + 1, bytes_.size());
      ++line_;
    }
  }

  /// The next number of the row. Nothing: there is none, or it is no number.
  std::optional<double> Next(PlyType type) {
    if (binary_) {
      const std::size_t size = PlyTypeSize(type);
      if (bytes_.size() - at_ < size) return std::nullopt;
      at_ += size;
      return LoadPlyNumber(type, bytes_.data() + at_ - size);
    }
    row_ = SkipBlanks(row_);
    double value = 0;
    const auto [stop, error] = std::from_chars(row_.data(), row_.data() + row_.size(), value);
    const char* const end = row_.data() + row_.size();
    if (error != std::errc() || (stop != end && SkipBlanks({stop, 1}) == std::string_view(stop, 1)))
      return std::nullopt;
    row_.remove_prefix(static_cast<std::size_t>(stop - row_.data()));
    return value;
  }

  /// Bytes that are left: no list is longer.
  std::size_t left() const { return bytes_.size() - at_ + row_.size(); }

  /// Why Next gave nothing in row `row` of `element`.
  absl::Status Missing(const PlyElement& element, std::uint64_t row) const {
    const std::string what = fmt::format("{} {} of {}", element.name, row, element.count);
    if (binary_ || (at_ == bytes_.size() && SkipBlanks(row_).empty())) {
      return Invalid(fmt::format("{}: the file ends early, in {}", path_, what));
    }
    return Invalid(fmt::format("{}:{}: {}: expected one more number, found '{}'", path_, line_,
                               what, Printable(row_)));
  }

  /// INVALID_ARGUMENT: `error` is wrong in row `row` of `element`.
  absl::Status ErrorAt(const PlyElement& element, std::uint64_t row, std::string_view error) const {
    const std::string place =
        binary_ ? fmt::format("{}: byte {}", path_, at_) : fmt::format("{}:{}", path_, line_);
    return Invalid(fmt::format("{}: {} {}: {}", place, element.name, row, error));
  }

 private:
  static std::string_view SkipBlanks(std::string_view text) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t\r"), text.size()));
    return text;
  }
  static std::string Printable(std::string_view text) {
    std::string printable(SkipBlanks(text).substr(0, 20));
    for (char& c : printable) {
      if (c < ' ' || c > '~') c = '?';
    }
    return printable;
  }

  bool binary_;
  const std::string& path_;
  std::string_view bytes_, row_;
  std::size_t at_ = 0;
  std::uint64_t line_ = 0;
};

absl::Status ReadVertices(const PlyElement& element, Numbers& numbers, Mesh& mesh) {
  std::array<int, 6> slots{};  // 1 + index of the property; 0: the file has none
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const auto name =
        std::find(kVertexNames.begin(), kVertexNames.end(), element.properties[i].name);
    if (name != kVertexNames.end() && !element.properties[i].list_count_type)
      slots[name - kVertexNames.begin()] = static_cast<int>(i) + 1;
  }
  const bool has_normals = slots[3] != 0 && slots[4] != 0 && slots[5] != 0;
  std::vector<double> values(element.properties.size());
  for (std::uint64_t row = 0; row < element.count; ++row) {
    numbers.BeginRow();
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto value = numbers.Next(element.properties[i].type);
      if (!value) return numbers.Missing(element, row);
      values[i] = *value;
    }
    std::array<float, 6> vertex{};
    for (std::size_t i = 0; i < (has_normals ? 6u : 3u); ++i) {
      const double value = values[slots[i] - 1];
      if (!(std::fabs(value) <= kMaxCoordinate)) {
        return numbers.ErrorAt(element, row,
                               fmt::format("{} is {}, it must be finite and within {:g}",
                                           kVertexNames[i], value, kMaxCoordinate));
      }
      vertex[i] = static_cast<float>(value);
    }
    mesh.vertices.push_back({vertex[0], vertex[1], vertex[2]});
    if (has_normals) mesh.normals.push_back({vertex[3], vertex[4], vertex[5]});
  }
  return absl::OkStatus();
}

bool IsCornerList(const PlyProperty& property) {
  return property.list_count_type &&
         (property.name == "vertex_indices" || property.name == "vertex_index");
}

/// Reads `count` corners and appends the fan of triangles that they are.
absl::Status ReadPolygon(const PlyElement& element, std::uint64_t row, const PlyProperty& property,
                         std::uint64_t count, Numbers& numbers, Mesh& mesh) {
  if (count < 3) return numbers.ErrorAt(element, row, fmt::format("{} corners", count));
  if (mesh.corners.size() + count - 2 > kMaxTriangles) {
    return absl::ResourceExhaustedError(
        numbers.ErrorAt(element, row, fmt::format("the limit is {} triangles", kMaxTriangles))
            .message());
  }
  std::array<std::uint32_t, 3> fan{};
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto index = numbers.Next(property.type);
    if (!index) return numbers.Missing(element, row);
    if (!(*index >= 0 && *index < static_cast<double>(mesh.vertices.size()) &&
          *index == std::floor(*index))) {
      return numbers.ErrorAt(element, row,
                             fmt::format("vertex {}: there are {}", *index, mesh.vertices.size()));
    }
    const auto corner = static_cast<std::uint32_t>(*index);
    if (i == 0) fan[0] = corner;
    fan[1] = fan[2];
    fan[2] = corner;
    if (i >= 2) mesh.corners.push_back(fan);
  }
  return absl::OkStatus();
}

/// Reads an element that has lists; what is not the corners of a polygon is passed over.
absl::Status ReadRows(const PlyElement& element, Numbers& numbers, Mesh& mesh) {
  for (std::uint64_t row = 0; row < element.count; ++row) {
    numbers.BeginRow();
    for (const PlyProperty& property : element.properties) {
      std::uint64_t count = 1;
      if (property.list_count_type) {
        const auto size = numbers.Next(*property.list_count_type);
        if (!size) return numbers.Missing(element, row);
        if (!(*size >= 0 && *size == std::floor(*size)))
          return numbers.ErrorAt(element, row, fmt::format("a list of {} numbers", *size));
        if (*size > static_cast<double>(numbers.left())) return numbers.Missing(element, row);
        count = static_cast<std::uint64_t>(*size);
      }
      if (element.name == "face" && IsCornerList(property)) {
        if (auto status = ReadPolygon(element, row, property, count, numbers, mesh); !status.ok())
          return status;
        continue;
      }
      for (std::uint64_t i = 0; i < count; ++i) {
        if (!numbers.Next(property.type)) return numbers.Missing(element, row);
      }
    }
  }
  return absl::OkStatus();
}

/// What the header must declare. An answer that is not empty says what is missing.
std::string CheckHeader(const PlyHeader& header, std::size_t data_size) {
  bool vertices = false, faces = false;
  for (const PlyElement& element : header.elements) {
    if (element.properties.empty())
      return fmt::format("element {} has no properties", element.name);
    // A number takes a byte at least; a line of ASCII has a line end or is the last.
    if (element.count > data_size) {
      return fmt::format("the file ends early: {} {} in {} bytes", element.count, element.name,
                         data_size);
    }
    const auto has = [&element](std::string_view name) {
      return std::any_of(
          element.properties.begin(), element.properties.end(),
          [name](const PlyProperty& p) { return p.name == name && !p.list_count_type; });
    };
    if (element.name == "vertex") {
      if (vertices) return "two elements vertex";
      vertices = has("x") && has("y") && has("z");
      if (!vertices) return "element vertex has no x, y and z";
      for (const PlyProperty& property : element.properties) {
        if (property.list_count_type) return "element vertex has a list";
      }
    } else if (element.name == "face") {
      if (!vertices) return "element face stands before element vertex";
      faces = std::any_of(element.properties.begin(), element.properties.end(), IsCornerList);
      if (!faces) return "element face has no list vertex_indices";
    }
  }
  if (!vertices) return "no element vertex";
  return faces ? "" : "no element face: it is no mesh";
}

}  // namespace

absl::StatusOr<Mesh> ParsePlyMesh(std::string_view bytes, const std::string& path) {
  std::istringstream stream{std::string(bytes.substr(0, kMaxHeader))};
  const auto header = ParsePlyHeader(stream, path);
  if (!header.ok()) return header.status();
  if (const auto error = CheckHeader(*header, bytes.size() - header->byte_count); !error.empty())
    return Invalid(fmt::format("{}: {}", path, error));
  Mesh mesh;
  Numbers numbers(bytes, *header, path);
  for (const PlyElement& element : header->elements) {
    const auto status = element.name == "vertex" ? ReadVertices(element, numbers, mesh)
                                                 : ReadRows(element, numbers, mesh);
    if (!status.ok()) return status;
  }
  mesh.materials.assign(mesh.corners.size(), 0);
  return mesh;
}

}  // namespace treelight::client
