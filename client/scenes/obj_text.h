#ifndef TREELIGHT_CLIENT_SCENES_OBJ_TEXT_H_
#define TREELIGHT_CLIENT_SCENES_OBJ_TEXT_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace treelight::client {

/// A Wavefront OBJ file that was checked.
struct ObjText {
  std::string text;  ///< one statement a line, without comments, indents and continuations
  /// Line in the file and name, in the order in which they occur.
  std::vector<std::pair<std::uint64_t, std::string>> libraries;
  std::vector<std::pair<std::uint64_t, std::string>> materials;  ///< each usemtl, each name once
  std::uint64_t triangle_count = 0;  ///< of all faces, a polygon of n corners being n - 2
};

/// Checks an OBJ file line by line before Assimp reads it, as Assimp does not say where a file is
/// broken, and passes over what it does not know. INVALID_ARGUMENT: a coordinate is no number or
/// beyond +-1e18, a face has fewer than three corners or names a vertex that is not there, a line
/// is not one of OBJ, or there is no face; the message is "PATH:LINE: ...".
absl::StatusOr<ObjText> CheckObj(std::string_view text, const std::string& path);

/// Checks the numbers of a material file (MTL) in the same way, and gives the names of its
/// materials. INVALID_ARGUMENT: a number is none, is negative or not finite.
absl::StatusOr<std::vector<std::string>> CheckMtl(std::string_view text, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_OBJ_TEXT_H_
