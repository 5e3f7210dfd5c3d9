#ifndef TREELIGHT_CLIENT_PLY_HEADER_H_
#define TREELIGHT_CLIENT_PLY_HEADER_H_

#include <cstddef>
#include <cstdint>
#include <istream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace treelight::client {

/// Number types of PLY; `float32` and the like are other names of the same.
enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

/// Size of a number in a binary file, bytes.
std::size_t PlyTypeSize(PlyType type);

/// The number of `type` that a binary file holds in the PlyTypeSize(type) bytes at `bytes`.
double LoadPlyNumber(PlyType type, const char* bytes);

/// One `property` line: a number or a list of numbers in every entry of an element.
struct PlyProperty {
  std::string name;                  ///< as in the file
  PlyType type = PlyType::kFloat32;  ///< of the number, or of those in the list
  std::optional<PlyType>
      list_count_type;  ///< of the count in front of a list; none for a single number
};

/// One `element` line and its properties: a table of the file, "vertex" for example.
struct PlyElement {
  std::string name;                     ///< as in the file
  std::uint64_t count = 0;              ///< as the header claims
  std::vector<PlyProperty> properties;  ///< in the order of the data
};

/// The header of a PLY file (Turk 1994, "The PLY Polygon File Format").
struct PlyHeader {
  bool binary = false;  ///< little-endian; else ASCII
  std::vector<PlyElement> elements;
  std::uint64_t line_count = 0;  ///< lines of the header
  std::uint64_t byte_count = 0;  ///< bytes of the header
};

/// Reads the next line of at most `max_size` bytes without its end, LF or CRLF. `none`: the stream
/// is at its end, or the line is longer. Adds the bytes taken from the stream to `byte_count`.
std::optional<std::string> ReadLine(std::istream& stream, std::size_t max_size,
                                    std::uint64_t& byte_count);

/// Splits at blanks and tabs; the views point into `line`.
std::vector<std::string_view> SplitWords(std::string_view line);

/// Parses the header of `stream`, which is left at the first byte of the data. INVALID_ARGUMENT: no
/// PLY, or one of big-endian order; the message names `path` and the line.
absl::StatusOr<PlyHeader> ParsePlyHeader(std::istream& stream, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_PLY_HEADER_H_
