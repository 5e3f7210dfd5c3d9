#ifndef TREELIGHT_CLIENT_SCENES_MESH_FILE_H_
#define TREELIGHT_CLIENT_SCENES_MESH_FILE_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// Triangles of one file at most.
inline constexpr std::uint64_t kMaxTriangles = 50'000'000;

/// Where the normals of a mesh come from.
enum class Normals {
  kFile,    ///< from the file; smoothed where it has none
  kSmooth,  ///< smoothed (AddSmoothNormals), whatever the file has
  kFlat,    ///< none: each triangle its own
};

/// How a mesh is read.
struct MeshFileOptions {
  Normals normals = Normals::kFile;
  float crease_degrees = 40;  ///< AddSmoothNormals' angle, [0, 180]
  /// Names of materials whose triangles are left out. It is an error where the file has none of
  /// that name.
  std::vector<std::string> dropped_materials{};
};

/// What a file has.
struct MeshFile {
  std::vector<Material> materials;  ///< those that triangles use, as docs/scenes.md translates them
  Mesh mesh;                        ///< as the file has it: no units, no axes are changed
  std::uint64_t degenerate_count = 0;  ///< triangles without area, which are left out
  std::vector<std::string> notes;      ///< what was assumed or left out, one line each
};

/// Whether the ending of `path` is one that ReadMeshFile knows: .obj, .ply, .gltf or .glb, each
/// also with .xz behind it.
bool IsMeshPath(std::string_view path);

/// Reads an OBJ, with the material files that it names, or a glTF 2 through Assimp, or a PLY;
/// packed or not.
///
/// Messages begin with the file's path, and its line where it has lines. Errors as ReadFileBytes';
/// INVALID_ARGUMENT also: the file is broken, has no triangle, or is of none of these kinds.
absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path, const MeshFileOptions& options = {});

/// The same for bytes in memory, unpacked. `path` tells the kind and where other files are.
absl::StatusOr<MeshFile> ParseMesh(std::string bytes, const std::string& path,
                                   const MeshFileOptions& options = {});

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_MESH_FILE_H_
