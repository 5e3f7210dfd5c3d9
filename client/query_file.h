#ifndef TREELIGHT_CLIENT_QUERY_FILE_H_
#define TREELIGHT_CLIENT_QUERY_FILE_H_

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/gatherer.h"

namespace treelight::client {

/// Points to gather around, with memory of their own.
struct QueryPoints {
  std::vector<float> positions;  ///< [3m] scene units, finite, within kMaxCoordinate
  std::vector<float> normals;    ///< [3m] or empty
  std::vector<float> radii;      ///< [m] scene units, [0, +inf]; or empty

  std::size_t size() const { return positions.size() / 3; }

  /// Views of the points [first, first + count).
  GatherQueries Slice(std::size_t first, std::size_t count) const;
};

/// Reads query points from a file whose first line is `ply`, else from CSV.
///
/// PLY: x, y, z, and where the file has them nx, ny, nz and r (or radius); the rest is skipped.
/// CSV: numbers between commas; lines that are empty or begin with # are skipped, and so is a UTF-8
/// byte order mark. The first line may name the columns: x, y, z, nx, ny, nz, r, in any order.
/// Without names the columns are x, y, z, then nx, ny, nz where there are 6 or 7, then r where
/// there are 4 or 7.
///
/// Errors name file and line (CSV, ASCII PLY) or vertex or byte (binary PLY). NOT_FOUND,
/// PERMISSION_DENIED and the like: the file cannot be opened. INVALID_ARGUMENT: it is damaged, or a
/// number is out of range.
absl::StatusOr<QueryPoints> ReadQueryFile(const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_QUERY_FILE_H_
