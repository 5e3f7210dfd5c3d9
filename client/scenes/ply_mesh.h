#ifndef TREELIGHT_CLIENT_SCENES_PLY_MESH_H_
#define TREELIGHT_CLIENT_SCENES_PLY_MESH_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// Reads the mesh of a PLY file, ASCII or binary little-endian: x, y, z, nx, ny, nz of its vertices
/// and its faces, polygons as fans of triangles, all of material 0. Own code, as Assimp 5.2 hangs
/// or crashes on files that end early. INVALID_ARGUMENT: the file is broken; the message is
/// "PATH:LINE: ..." or "PATH: byte N: ...". RESOURCE_EXHAUSTED: more than kMaxTriangles.
absl::StatusOr<Mesh> ParsePlyMesh(std::string_view bytes, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_PLY_MESH_H_
