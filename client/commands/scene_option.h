#ifndef TREELIGHT_CLIENT_COMMANDS_SCENE_OPTION_H_
#define TREELIGHT_CLIENT_COMMANDS_SCENE_OPTION_H_

#include <optional>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/scenes/load_scene.h"

namespace treelight::client {

/// What a command line says about the scene.
struct SceneChoice {
  std::string scene = "cornell";  ///< as LoadScene takes it
  std::string camera;             ///< name of one of the scene's cameras; empty: the first
  std::optional<Vec3> camera_position, camera_target, camera_up;  ///< in place of the camera's own
  std::optional<float> camera_fov;  ///< vertical, degrees, in place of the camera's own
  std::vector<PointLight> lights;   ///< in place of the light that a bare mesh is given; else added
  std::vector<std::string> materials;  ///< NAME:KEY=VALUE, as docs/scenes.md has it
};

/// Adds --scene, --camera and --camera-*, --light and --material to `command`. They are parsed to
/// `choice`, which must outlive the parsing. CLI::ValidationError: a value is no such thing.
void AddSceneOptions(CLI::App& command, SceneChoice& choice);

/// The scene that was chosen, its camera, lights and materials as the flags say. What the loader
/// assumed or left out goes to stderr. Errors as LoadScene's; NOT_FOUND also: there is no such
/// camera or material. INVALID_ARGUMENT also: the camera sees nothing, as its position is its
/// target.
absl::StatusOr<LoadedScene> LoadChosenScene(const SceneChoice& choice);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_SCENE_OPTION_H_
