#include "client/commands/scene_option.h"

#include <charconv>
#include <utility>

#include "client/commands/output.h"
#include "client/scenes/material_json.h"
#include "client/scenes/registry.h"
#include "client/scenes/vector.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

/// `count` numbers separated by commas, each within +-1e18.
std::vector<float> ParseNumbers(const std::string& option, const std::string& text,
                                std::size_t count, const char* form) {
  std::vector<float> numbers;
  for (std::string_view rest = text;;) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    float number = 0;
    const auto [stop, error] = std::from_chars(rest.data(), rest.data() + comma, number);
    const bool good =
        error == std::errc() && stop == rest.data() + comma && number >= -1e18f && number <= 1e18f;
    if (!good) throw CLI::ValidationError(option, fmt::format("'{}' is not {}", text, form));
    numbers.push_back(number);
    if (comma == rest.size()) break;
    rest.remove_prefix(comma + 1);
  }
  if (numbers.size() != count)
    throw CLI::ValidationError(option, fmt::format("'{}' is not {}", text, form));
  return numbers;
}

void AddPointOption(CLI::App& command, const std::string& name, std::optional<Vec3>& point,
                    const std::string& what) {
  command
      .add_option_function<std::string>(
          name,
          [&point, name](const std::string& text) {
            const auto v = ParseNumbers(name, text, 3, "X,Y,Z");
            point = Vec3{v[0], v[1], v[2]};
          },
          what)
      ->type_name("X,Y,Z");
}

void AddLightOption(CLI::App& command, std::vector<PointLight>& lights) {
  command
      .add_option_function<std::vector<std::string>>(
          "--light",
          [&lights](const std::vector<std::string>& texts) {
            lights.clear();
            for (const std::string& text : texts) {
              const auto v = ParseNumbers("--light", text, 6, "X,Y,Z,R,G,B: a position and W/sr");
              if (v[3] < 0 || v[4] < 0 || v[5] < 0) {
                throw CLI::ValidationError("--light",
                                           fmt::format("'{}' has a negative intensity", text));
              }
              lights.push_back({.position = {v[0], v[1], v[2]}, .intensity = {v[3], v[4], v[5]}});
            }
          },
          "Adds a point light: position, then intensity in W/sr; may be given more than once")
      ->type_name("X,Y,Z,R,G,B");
}

absl::Status ChooseCamera(const SceneChoice& choice, LoadedScene& loaded) {
  Camera& camera = loaded.scene.camera;
  if (!choice.camera.empty()) {
    const auto found = FindCamera(loaded, choice.camera);
    if (!found.ok()) return found.status();
    camera = *found;
  }
  camera.position = choice.camera_position.value_or(camera.position);
  camera.target = choice.camera_target.value_or(camera.target);
  camera.up = choice.camera_up.value_or(camera.up);
  camera.vertical_fov_degrees = choice.camera_fov.value_or(camera.vertical_fov_degrees);
  const Vec3 view = camera.target - camera.position;
  if (Length(Cross(view, camera.up)) > 1e-4f * Length(view) * Length(camera.up))
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      "the camera has no view: its target is its position, or its up is parallel to the view");
}

/// Takes out the light that a bare mesh was given.
void RemoveDefaultLight(LoadedScene& loaded) {
  Mesh& mesh = loaded.scene.mesh;
  mesh.corners.resize(mesh.corners.size() - 2);
  mesh.materials.resize(mesh.materials.size() - 2);
  loaded.notes.pop_back();
  loaded.has_default_light = false;
}

}  // namespace

void AddSceneOptions(CLI::App& command, SceneChoice& choice) {
  command
      .add_option("--scene", choice.scene,
                  fmt::format("{}, or a file: a scene (.json) or a mesh (.obj, .ply, .gltf, .glb)",
                              fmt::join(BuiltInScenes(), ", ")))
      ->capture_default_str()
      ->type_name("NAME|FILE");
  command.add_option("--camera", choice.camera, "One of the scene's cameras (default: its first)")
      ->type_name("NAME");
  AddPointOption(command, "--camera-position", choice.camera_position, "In place of the camera's");
  AddPointOption(command, "--camera-target", choice.camera_target, "In place of the camera's");
  AddPointOption(command, "--camera-up", choice.camera_up, "In place of the camera's");
  command
      .add_option("--camera-fov", choice.camera_fov,
                  "Angle between lower and upper edge, degrees, in place of the camera's")
      ->check(CLI::Range(0.1, 179.0))
      ->type_name("DEGREES");
  AddLightOption(command, choice.lights);
  command
      .add_option("--material", choice.materials,
                  "Sets a field of the scene's material NAME, as in a scene file: "
                  "floor:reflectance=0.5,0.4,0.3 or ring:surface=mirror; may be given more than "
                  "once")
      ->type_name("NAME:KEY=VALUE");
}

absl::StatusOr<LoadedScene> LoadChosenScene(const SceneChoice& choice) {
  auto loaded = LoadScene(choice.scene);
  if (!loaded.ok()) return loaded.status();
  if (auto status = ChooseCamera(choice, *loaded); !status.ok()) return status;
  if (!choice.lights.empty() && loaded->has_default_light) RemoveDefaultLight(*loaded);
  for (const PointLight& light : choice.lights) loaded->scene.point_lights.push_back(light);
  for (const std::string& assignment : choice.materials) {
    if (auto status = OverrideMaterial(assignment, loaded->scene); !status.ok()) return status;
  }
  for (const std::string& note : loaded->notes) Warn(note);
  return loaded;
}

}  // namespace treelight::client
