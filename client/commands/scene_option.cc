#include "client/commands/scene_option.h"

#include <utility>

#include "client/commands/check.h"
#include "client/commands/output.h"
#include "client/scenes/registry.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {

void AddSceneOptions(CLI::App& command, SceneChoice& choice) {
  command
      .add_option(
          "--scene", choice.scene,
          fmt::format("{}, or a file: a scene (.json) or a mesh", fmt::join(BuiltInScenes(), ", ")))
      ->capture_default_str()
      ->type_name("NAME|FILE");
  command.add_option("--camera", choice.camera, "One of the scene's cameras (default: its first)")
      ->type_name("NAME");
}

absl::StatusOr<LoadedScene> LoadChosenScene(const SceneChoice& choice) {
  auto loaded = LoadScene(choice.scene);
  if (!loaded.ok()) return loaded.status();
  for (const std::string& note : loaded->notes) Warn(note);
  if (!choice.camera.empty()) {
    const auto camera = FindCamera(*loaded, choice.camera);
    if (!camera.ok()) return camera.status();
    loaded->scene.camera = *camera;
  }
  return loaded;
}

}  // namespace treelight::client
