#include "client/study/study_scene.h"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <utility>

#include "client/scenes/scene_file.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// A scene as a scene file has it (docs/scenes.md), and what takes its place.
struct Recipe {
  std::string_view name, mesh, text;
  std::string_view stand_in, stand_in_text;
};

constexpr Recipe kRecipes[] = {{"sibenik", "sibenik/sibenik.obj.xz", R"({
       "meshes": [{"file": "sibenik/sibenik.obj.xz", "normals": "flat"}],
       "lights": [{"type": "point", "position": [-4, -4.5, 0], "intensity": 40}],
       "cameras": [
         {"name": "west", "position": [-17, -12.2, 0.4], "target": [0, -10, 0], "vertical_fov_degrees": 70},
         {"name": "east", "position": [14, -12.2, 0.4], "target": [-3, -10, 0], "vertical_fov_degrees": 70}]})",
                                "hall", R"({"built_in": "hall", "cameras": [
         {"name": "west", "position": [0.5, 1.8, 13.5], "target": [0, 4, 0], "vertical_fov_degrees": 70},
         {"name": "east", "position": [-0.5, 1.8, -13.5], "target": [0, 4, 0], "vertical_fov_degrees": 70}]})"},
                               {"dragon", "dragon/dragon_vrip.ply.xz", R"({
       "new_materials": {"ground": {"reflectance": 0.65}},
       "meshes": [{"file": "dragon/dragon_vrip.ply.xz", "scale": 10, "normals": "flat",
                   "translate": [0, -0.527, 0]}],
       "quads": [{"center": [0, 0, 0], "size": [6, 6], "material": "ground"}],
       "lights": [{"type": "area", "center": [-1.5, 4, 1.5], "direction": [1.5, -3.4, -1.5],
                   "size": [1.4, 1.4], "radiance": 30}],
       "cameras": [
         {"name": "front", "position": [0.6, 1.5, 3.6], "target": [-0.05, 0.5, 0], "vertical_fov_degrees": 36},
         {"name": "back", "position": [-0.6, 1.5, -3.6], "target": [-0.05, 0.5, 0], "vertical_fov_degrees": 36}]})",
                                "blob", R"({"built_in": "blob", "cameras": [
         {"name": "front", "position": [1.2, 2.4, 4.6], "target": [0, 0.95, 0], "vertical_fov_degrees": 38},
         {"name": "back", "position": [-1.2, 2.4, -4.6], "target": [0, 0.95, 0], "vertical_fov_degrees": 38}]})"},
                               {"conference", "conference/conference_lbl.obj.xz", R"({
       "meshes": [{"file": "conference/conference_lbl.obj.xz", "up": "z", "normals": "flat"}],
       "cameras": [
         {"name": "west", "position": [0.8, 1.7, -3.4], "target": [6, 1, -3.4], "vertical_fov_degrees": 70},
         {"name": "east", "position": [10.2, 1.7, -3.4], "target": [5, 1, -3.4], "vertical_fov_degrees": 70}]})",
                                "room", R"({"built_in": "room", "cameras": [
         {"name": "west", "position": [-4.9, 1.75, 2.4], "target": [0.6, 0.7, -0.7], "vertical_fov_degrees": 70},
         {"name": "east", "position": [4.9, 1.75, -2.4], "target": [-0.6, 0.7, 0.7], "vertical_fov_degrees": 70}]})"}};

}  // namespace

std::vector<std::string> StudySceneNames() {
  std::vector<std::string> names;
  for (const Recipe& recipe : kRecipes) names.emplace_back(recipe.name);
  return names;
}

absl::StatusOr<StudyScene> LoadStudyScene(const std::string& name, const std::string& folder) {
  const auto* const recipe = std::find_if(std::begin(kRecipes), std::end(kRecipes),
                                          [&](const Recipe& r) { return r.name == name; });
  if (recipe == std::end(kRecipes)) {
    return absl::InvalidArgumentError(fmt::format(
        "there is no scene \"{}\" in the study; it has sibenik, dragon, conference", name));
  }
  StudyScene study{.name = name, .note = {}, .scene = {}, .cameras = {}};
  std::string_view text = recipe->text;
  std::error_code error;
  const auto mesh = std::filesystem::path(folder) / recipe->mesh;
  if (folder.empty() || !std::filesystem::exists(mesh, error)) {
    study.name = recipe->stand_in;
    study.note = fmt::format("the built-in scene {} stands in for {}: {}", recipe->stand_in, name,
                             folder.empty() ? "no folder of scenes is given (--scenes)"
                                            : fmt::format("there is no \"{}\"", mesh.string()));
    text = recipe->stand_in_text;
  }
  // A scene file in that folder finds its meshes beside it.
  auto loaded = ParseSceneFile(text, (std::filesystem::path(folder) / "study.json").string());
  if (!loaded.ok()) return loaded.status();
  study.scene = std::move(loaded->scene);
  study.scene.name = study.name;
  MakeDiffuse(kStudyAlbedo, study.scene);
  for (std::size_t i = 0; i < study.cameras.size(); ++i)
    study.cameras[i] = loaded->cameras[i].camera;
  return study;
}

}  // namespace treelight::client
