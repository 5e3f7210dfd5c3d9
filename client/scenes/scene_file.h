#ifndef TREELIGHT_CLIENT_SCENES_SCENE_FILE_H_
#define TREELIGHT_CLIENT_SCENES_SCENE_FILE_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "client/scenes/load_scene.h"

namespace treelight::client {

/// Reads a scene file, JSON; docs/scenes.md has its keys. Meshes are looked for in the folder of
/// `path`, then in the folder that the environment variable TREELIGHT_SCENES names.
///
/// INVALID_ARGUMENT: it is no JSON ("PATH:LINE:COLUMN: ..."), or a value is wrong ("PATH:
/// lights[1].intensity: 3 numbers, not 2"). NOT_FOUND: a mesh is in neither folder. Errors of
/// ReadMeshFile and ReadFileBytes as they are.
absl::StatusOr<LoadedScene> ReadSceneFile(const std::string& path);

/// The same for the text of a scene file.
absl::StatusOr<LoadedScene> ParseSceneFile(std::string_view text, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_SCENE_FILE_H_
