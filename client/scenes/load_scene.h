#ifndef TREELIGHT_CLIENT_SCENES_LOAD_SCENE_H_
#define TREELIGHT_CLIENT_SCENES_LOAD_SCENE_H_

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// A camera and what it is called.
struct NamedCamera {
  std::string name;
  Camera camera;
};

/// A scene and what comes with it.
struct LoadedScene {
  Scene scene;                       ///< seen by the first of `cameras`
  std::vector<NamedCamera> cameras;  ///< at least one
  float exposure = 1;                ///< with which its PNG is neither dark nor burnt out, stops
  bool has_default_light = false;    ///< its only light was made up, as a bare mesh has none: the
                                     ///< last two triangles, and the last note
  std::vector<std::string> notes;    ///< what was assumed or left out, one line each, for a person
};

/// The scene that `name_or_path` names: a built-in scene (docs/scenes.md lists them), else a file:
/// a scene file (.json) or a mesh that ReadMeshFile reads, which gets a camera that sees all of it
/// and, where nothing in it shines, a light.
///
/// NOT_FOUND: there is neither such a scene nor such a file; the message lists what is built in.
/// INVALID_ARGUMENT: a file is broken; the message names file, place, value and what was expected.
/// RESOURCE_EXHAUSTED: a file is over a limit.
absl::StatusOr<LoadedScene> LoadScene(const std::string& name_or_path);

/// What Scene::name becomes: the name of a built-in scene, the stem of a file ("sibenik" for
/// "scenes/sibenik.json", "dragon" for "dragon.ply.xz"), with '-' for each character that a map's
/// name may not have. Reads nothing.
std::string SceneName(std::string_view name_or_path);

/// The camera of that name. NOT_FOUND: there is none; the message lists those there are.
absl::StatusOr<Camera> FindCamera(const LoadedScene& scene, std::string_view name);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_LOAD_SCENE_H_
