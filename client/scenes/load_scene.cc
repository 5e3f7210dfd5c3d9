#include "client/scenes/load_scene.h"

#include <utility>

#include "client/scenes/default_view.h"
#include "client/scenes/mesh_file.h"
#include "client/scenes/registry.h"
#include "client/scenes/scene_file.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {

namespace {

absl::StatusOr<LoadedScene> LoadBareMesh(const std::string& path) {
  auto file = ReadMeshFile(path);
  if (!file.ok()) return file.status();
  LoadedScene loaded{.scene = {}, .cameras = {}, .notes = std::move(file->notes)};
  Scene& scene = loaded.scene;
  scene.name = SceneName(path);
  scene.materials = std::move(file->materials);
  scene.mesh = std::move(file->mesh);
  scene.camera = MakeDefaultCamera(scene);
  loaded.cameras.push_back({"default", scene.camera});
  const bool has_light = HasLight(scene);
  if (!has_light) AddDefaultLight(scene);
  loaded.notes.push_back(fmt::format("{}: seen by a camera that was made up", path));
  loaded.has_default_light = !has_light;
  if (!has_light) loaded.notes.push_back(fmt::format("{}: lit by a lamp that was made up", path));
  return loaded;
}

}  // namespace

absl::StatusOr<LoadedScene> LoadScene(const std::string& name_or_path) {
  auto scene = MakeScene(name_or_path);
  if (scene.ok()) {
    LoadedScene loaded{.scene = *std::move(scene), .cameras = {}, .notes = {}};
    loaded.cameras.push_back({"default", loaded.scene.camera});
    return loaded;
  }
  if (name_or_path.ends_with(".json")) return ReadSceneFile(name_or_path);
  if (IsMeshPath(name_or_path)) return LoadBareMesh(name_or_path);
  return absl::NotFoundError(
      fmt::format("there is no scene \"{}\": neither one that is built in ({}) nor a file ending "
                  "in .json, .obj, "
                  ".ply, .gltf or .glb",
                  name_or_path, fmt::join(BuiltInScenes(), ", ")));
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
