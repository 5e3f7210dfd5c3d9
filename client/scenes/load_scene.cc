#include "client/scenes/load_scene.h"

#include <utility>

#include "client/scenes/registry.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {

absl::StatusOr<LoadedScene> LoadScene(const std::string& name_or_path) {
  auto scene = MakeScene(name_or_path);
  if (!scene.ok()) return scene.status();
  LoadedScene loaded{.scene = *std::move(scene), .cameras = {}, .notes = {}};
  loaded.cameras.push_back({"default", loaded.scene.camera});
  return loaded;
}

std::string SceneName(std::string_view name_or_path) {
  std::string_view stem = name_or_path.substr(name_or_path.find_last_of('/') + 1);
  if (stem.ends_with(".xz")) stem.remove_suffix(3);
  if (const auto dot = stem.find_last_of('.'); dot != stem.npos && dot > 0) {
    stem = stem.substr(0, dot);
  }
  std::string name(stem.substr(0, 100));
  for (char& c : name) {
    const bool good = (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
                      c == '.' || c == '_' || c == '-';
    if (!good) c = '-';
  }
  return name.empty() ? "scene" : name;
}

absl::StatusOr<Camera> FindCamera(const LoadedScene& scene, std::string_view name) {
  std::vector<std::string_view> names;
  for (const NamedCamera& camera : scene.cameras) {
    if (camera.name == name) return camera.camera;
    names.push_back(camera.name);
  }
  return absl::NotFoundError(fmt::format("scene {} has no camera \"{}\"; it has: {}",
                                         scene.scene.name, name, fmt::join(names, ", ")));
}

}  // namespace treelight::client
