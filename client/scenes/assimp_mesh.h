#ifndef TREELIGHT_CLIENT_SCENES_ASSIMP_MESH_H_
#define TREELIGHT_CLIENT_SCENES_ASSIMP_MESH_H_

#include <string>

#include "absl/status/statusor.h"
#include "client/scenes/mesh_file.h"

namespace treelight::client {

/// Reads an OBJ that CheckObj lets pass. The material files that it names are looked for in the
/// folder of `path`, packed or not; a note tells which are missing, and which materials are in
/// none of them. Notes and errors begin with `path`.
absl::StatusOr<MeshFile> ReadObj(std::string_view bytes, const std::string& path);

/// Reads a glTF 2 or GLB. The transforms of its nodes are applied; its cameras and lights
/// are passed over. Buffers are looked for in the folder of `path`.
absl::StatusOr<MeshFile> ReadGltf(std::string bytes, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_ASSIMP_MESH_H_
