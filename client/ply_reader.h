#ifndef TREELIGHT_CLIENT_PLY_READER_H_
#define TREELIGHT_CLIENT_PLY_READER_H_

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/ply_header.h"

namespace treelight::client {

/// Reads the numbers of the `vertex` element of a PLY file, ASCII or binary little-endian; skips
/// everything else. Own code because Debian packages no PLY library but Assimp, which drops
/// properties that it does not know.
///
/// Errors name file and line or byte. NOT_FOUND, PERMISSION_DENIED and the like: the file cannot be
/// opened. INVALID_ARGUMENT: it is no PLY, is damaged or ends early.
class PlyReader {
 public:
  /// Opens `path` and reads the header. INVALID_ARGUMENT also where it has no vertices of x, y and
  /// z.
  static absl::StatusOr<PlyReader> Open(const std::string& path);

  /// Vertices as the header claims; not more than the file has bytes.
  std::uint64_t vertex_count() const { return header_.elements[vertex_].count; }

  /// Whether a vertex has the number `property`.
  bool Has(std::string_view property) const;

  /// Gets the number of the vertex and its values of the properties that were asked for. An error
  /// ends the reading.
  using Visit = std::function<absl::Status(std::uint64_t index, std::span<const double> values)>;

  /// Calls `visit` for each vertex in order, with the values of `properties`, all of which the file
  /// has. Once.
  absl::Status ReadVertices(std::span<const std::string_view> properties, const Visit& visit);

  /// INVALID_ARGUMENT: `what` is wrong with vertex `index`.
  absl::Status VertexError(std::uint64_t index, std::string_view what) const;

 private:
  PlyReader() = default;

  // Reads all rows of `element`. Property i goes to values[slots[i]] where slots[i] >= 0; `visit`
  // may be null.
  absl::Status ReadElement(const PlyElement& element, std::span<const int> slots,
                           std::span<double> values, const Visit* visit);
  absl::Status ReadBinaryRow(const PlyElement& element, std::span<const int> slots,
                             std::span<double> values);
  absl::Status ReadAsciiRow(const PlyElement& element, std::span<const int> slots,
                            std::span<double> values);
  // Takes `size` bytes of the file, at most kBufferSize; null where it ends before. Valid until the
  // next call.
  const char* Take(std::size_t size);
  absl::Status Truncated(const PlyElement& element) const;
  absl::Status LineError(const PlyElement& element, std::string_view what) const;

  std::string path_;
  std::ifstream stream_;
  PlyHeader header_;
  std::size_t vertex_ = 0;                          // index in header_.elements
  std::uint64_t file_size_ = 0;                     // bytes
  std::uint64_t line_ = 0;                          // lines read; ASCII
  std::uint64_t row_ = 0;                           // of the element that is read
  std::vector<char> buffer_;                        // bytes read ahead; binary
  std::size_t buffer_first_ = 0, buffer_last_ = 0;  // those of buffer_ that were not taken
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_PLY_READER_H_
