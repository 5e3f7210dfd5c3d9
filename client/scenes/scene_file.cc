#include "client/scenes/scene_file.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <utility>
#include <vector>

#include "client/scenes/file_bytes.h"
#include "client/scenes/json_object.h"
#include "client/scenes/json_text.h"
#include "client/scenes/material_json.h"
#include "client/scenes/mesh_file.h"
#include "client/scenes/registry.h"
#include "client/scenes/shapes.h"
#include "client/scenes/vector.h"
#include "core/model/photons.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

/// Where the file of a mesh is: beside the scene file, else in $TREELIGHT_SCENES.
absl::StatusOr<std::string> FindMeshFile(const std::string& name, const std::string& scene_path) {
  const std::filesystem::path folder = std::filesystem::path(scene_path).parent_path();
  std::error_code error;
  const std::filesystem::path beside = folder / name;
  if (std::filesystem::exists(beside, error)) return beside.string();
  const char* const shared = std::getenv("TREELIGHT_SCENES");
  if (shared == nullptr || *shared == 0) {
    return absl::NotFoundError(fmt::format(
        "there is no \"{}\"; set TREELIGHT_SCENES to the folder that it is in", beside.string()));
  }
  const std::filesystem::path in_shared = std::filesystem::path(shared) / name;
  if (std::filesystem::exists(in_shared, error)) return in_shared.string();
  return absl::NotFoundError(fmt::format("there is neither \"{}\" nor \"{}\" (TREELIGHT_SCENES)",
                                         beside.string(), in_shared.string()));
}

/// What becomes of the coordinates of a mesh: x -> scale * turn(x) + translation.
struct Placement {
  bool z_up = false;  // (x, y, z) -> (x, z, -y) before the rest
  float scale = 1;
  float cosine = 1, sine = 0;  // of the turn about y, counter-clockwise seen from above
  Vec3 translation;

  Vec3 Turn(Vec3 v) const {
    if (z_up) v = {v.x, v.z, -v.y};
    return {cosine * v.x + sine * v.z, v.y, cosine * v.z - sine * v.x};
  }
  Vec3 Place(const Vec3& v) const { return scale * Turn(v) + translation; }
};

void Append(MeshFile file, const Placement& placement, Scene& scene) {
  Mesh& mesh = scene.mesh;
  const auto first_vertex = static_cast<std::uint32_t>(mesh.vertices.size());
  const auto first_material = static_cast<std::uint32_t>(scene.materials.size());
  if (!file.mesh.normals.empty()) mesh.normals.resize(mesh.vertices.size());
  for (const Vec3& v : file.mesh.vertices) mesh.vertices.push_back(placement.Place(v));
  for (const Vec3& n : file.mesh.normals) mesh.normals.push_back(placement.Turn(n));
  if (!mesh.normals.empty()) mesh.normals.resize(mesh.vertices.size());
  for (const auto& c : file.mesh.corners)
    mesh.corners.push_back({first_vertex + c[0], first_vertex + c[1], first_vertex + c[2]});
  for (const std::uint32_t material : file.mesh.materials)
    mesh.materials.push_back(first_material + material);
  std::move(file.materials.begin(), file.materials.end(), std::back_inserter(scene.materials));
}

/// Turns the triangles of the materials of these names around, so that their backs are fronts.
void Flip(const std::vector<std::string>& names, JsonObject& json, MeshFile& file) {
  for (const std::string& name : names) {
    bool found = false;
    for (std::size_t i = 0; i < file.mesh.corners.size(); ++i) {
      if (file.materials[file.mesh.materials[i]].name != name) continue;
      std::swap(file.mesh.corners[i][1], file.mesh.corners[i][2]);
      found = true;
    }
    if (!found) json.Fail("flip_materials", fmt::format("the mesh has no material \"{}\"", name));
  }
}

/// Index of the first material of that name. An error where there is none.
std::uint32_t MaterialIndex(const std::string& name, const char* key, JsonObject& json,
                            const Scene& scene) {
  std::vector<std::string_view> names;
  for (std::uint32_t i = 0; i < scene.materials.size(); ++i) {
    if (scene.materials[i].name == name) return i;
    names.push_back(scene.materials[i].name);
  }
  json.Fail(
      key, fmt::format("there is no material \"{}\"; there are: {}", name, fmt::join(names, ", ")));
  return 0;
}

/// `status` is that of `json`.
absl::Status ReadMesh(JsonObject& json, const absl::Status& status, const std::string& scene_path,
                      LoadedScene& loaded) {
  const std::string name = json.Text("file");
  MeshFileOptions options;
  options.normals = static_cast<Normals>(json.Choice("normals", {"file", "smooth", "flat"}, 0));
  options.crease_degrees = static_cast<float>(json.Number("crease_degrees", {0, 180}, 40));
  options.dropped_materials = json.Texts("drop_materials");
  const auto flipped = json.Texts("flip_materials");
  const std::string material = json.Text("material", "");
  Placement placement;
  placement.z_up = json.Choice("up", {"y", "z"}, 0) == 1;
  placement.scale = static_cast<float>(json.Number("scale", kPositive, 1));
  const double angle = json.Number("turn_degrees", {-360, 360}, 0) * std::numbers::pi / 180;
  placement.cosine = static_cast<float>(std::cos(angle));
  placement.sine = static_cast<float>(std::sin(angle));
  placement.translation = json.Vector("translate", Vec3{});
  json.RefuseOtherKeys();
  if (!status.ok()) return status;  // before files are looked for by a name that was none
  const auto path = FindMeshFile(name, scene_path);
  if (!path.ok()) {
    return absl::Status(path.status().code(),
                        fmt::format("{}: {}.file: {}", scene_path, json.place(),
                                    std::string(path.status().message())));
  }
  auto file = ReadMeshFile(*path, options);
  if (!file.ok()) return file.status();
  Flip(flipped, json, *file);
  std::move(file->notes.begin(), file->notes.end(), std::back_inserter(loaded.notes));
  if (!material.empty()) {
    file->materials.assign(file->materials.size(), {.name = material, .reflectance = {}});
    const auto& all = loaded.scene.materials;
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const Material& m) { return m.name == material; });
    if (found == all.end()) {
      json.Fail("material", fmt::format("\"new_materials\" has no \"{}\"", material));
    } else {
      std::fill(file->materials.begin(), file->materials.end(), *found);
    }
  }
  Append(*std::move(file), placement, loaded.scene);
  return absl::OkStatus();
}

std::pair<float, float> ReadSize(JsonObject& json) {
  const auto size = json.Numbers("size", 2, kPositive);
  return {static_cast<float>(size[0]), static_cast<float>(size[1])};
}

void ReadQuad(JsonObject& json, Scene& scene) {
  const Vec3 center = json.Vector("center");
  const Vec3 normal = json.Direction("normal", Vec3{0, 1, 0});
  const auto [width, height] = ReadSize(json);
  const auto material = MaterialIndex(json.Text("material"), "material", json, scene);
  json.RefuseOtherKeys();
  AddRectangle(center, normal, width, height, material, scene.mesh);
}

void ReadSphere(JsonObject& json, Scene& scene) {
  Sphere sphere{.center = json.Vector("center")};
  sphere.radius = static_cast<float>(json.Number("radius", kPositive));
  sphere.material = MaterialIndex(json.Text("material"), "material", json, scene);
  json.RefuseOtherKeys();
  if (!scene.materials.empty() && MaxChannel(scene.materials[sphere.material].emission) > 0)
    json.Fail("material", "spheres do not emit");
  scene.spheres.push_back(sphere);
}

void ReadLight(JsonObject& json, Scene& scene) {
  const int type = json.Choice("type", {"point", "spot", "area"});
  if (type == 2) {
    const Vec3 center = json.Vector("center");
    const Vec3 direction = json.Direction("direction", Vec3{0, -1, 0});
    const auto [width, height] = ReadSize(json);
    Material material{.name = json.place(), .reflectance = {}};
    material.emission = json.Color("radiance", kNotNegative);
    json.RefuseOtherKeys();
    scene.materials.push_back(std::move(material));
    AddRectangle(center, direction, width, height,
                 static_cast<std::uint32_t>(scene.materials.size() - 1), scene.mesh);
    return;
  }
  PointLight light{.position = json.Vector("position"),
                   .intensity = json.Color("intensity", kNotNegative)};
  if (type == 1) {
    light.direction = json.Direction("direction", Vec3{0, -1, 0});
    const double cone = json.Number("cone_degrees", {1e-3, 180});
    light.cone_degrees = static_cast<float>(cone);
    light.falloff_begin_degrees =
        static_cast<float>(json.Number("falloff_begin_degrees", {0, cone}, cone));
  }
  json.RefuseOtherKeys();
  scene.point_lights.push_back(light);
}

NamedCamera ReadCamera(JsonObject& json) {
  NamedCamera named{.name = json.Text("name"), .camera = {}};
  Camera& camera = named.camera;
  camera.position = json.Vector("position");
  camera.target = json.Vector("target");
  camera.up = json.Direction("up", Vec3{0, 1, 0});
  camera.vertical_fov_degrees =
      static_cast<float>(json.Number("vertical_fov_degrees", {0.1, 179}, 40));
  json.RefuseOtherKeys();
  const Vec3 view = camera.target - camera.position;
  if (!(Length(Cross(view, camera.up)) > 1e-4f * Length(view)))
    json.Fail("", "\"up\" is parallel to the view, or the target is the position");
  return named;
}

void ReadCameras(JsonObject& root, LoadedScene& loaded) {
  auto cameras = root.Objects("cameras");
  if (cameras.empty() && loaded.cameras.empty()) root.Fail("cameras", "there must be one");
  if (!cameras.empty()) loaded.cameras.clear();
  for (JsonObject& json : cameras) {
    NamedCamera camera = ReadCamera(json);
    for (const NamedCamera& other : loaded.cameras) {
      if (other.name == camera.name) json.Fail("name", fmt::format("a second \"{}\"", camera.name));
    }
    loaded.cameras.push_back(std::move(camera));
  }
}

void ReadNewMaterials(JsonObject& root, Scene& scene) {
  for (auto& [name, json] : root.Members("new_materials")) {
    Material material{.name = name, .reflectance = {}};
    ReadMaterial(json, material);
    scene.materials.push_back(std::move(material));
  }
}

void OverrideMaterials(JsonObject& root, Scene& scene) {
  for (auto& [name, json] : root.Members("materials")) {
    MaterialIndex(name, "materials", root, scene);  // is there one?
    for (Material& material : scene.materials) {
      if (material.name == name) ReadMaterial(json, material);
    }
  }
}

}  // namespace

absl::StatusOr<LoadedScene> ParseSceneFile(std::string_view text, const std::string& path) {
  const auto json = ParseJson(text, path);
  if (!json.ok()) return json.status();
  absl::Status status;
  JsonObject root(*json, path, "", status);
  LoadedScene loaded{.scene = {}, .cameras = {}, .notes = {}};
  Scene& scene = loaded.scene;
  if (const std::string name = root.Text("built_in", ""); root.Has("built_in")) {
    if (!status.ok()) return status;
    auto base = MakeScene(name);
    if (!base.ok()) root.Fail("built_in", std::string(base.status().message()));
    if (!status.ok()) return status;
    scene = *std::move(base);
    loaded.cameras.push_back({"default", scene.camera});
  }
  root.Text("description", "");  // for people
  loaded.exposure = static_cast<float>(root.Number("exposure", {-100, 100}, 1));
  ReadNewMaterials(root, scene);
  for (JsonObject& mesh : root.Objects("meshes")) {
    if (!status.ok()) return status;
    if (auto read = ReadMesh(mesh, status, path, loaded); !read.ok()) return read;
  }
  OverrideMaterials(root, scene);
  for (JsonObject& quad : root.Objects("quads")) ReadQuad(quad, scene);
  for (JsonObject& sphere : root.Objects("spheres")) ReadSphere(sphere, scene);
  for (JsonObject& light : root.Objects("lights")) ReadLight(light, scene);
  ReadCameras(root, loaded);
  root.RefuseOtherKeys();
  if (status.ok() && scene.mesh.corners.empty() && scene.spheres.empty())
    root.Fail("", "it has neither meshes nor quads nor spheres");
  if (!status.ok()) return status;
  scene.name = SceneName(path);
  scene.camera = loaded.cameras.front().camera;
  return loaded;
}

absl::StatusOr<LoadedScene> ReadSceneFile(const std::string& path) {
  constexpr std::uint64_t kMaxSceneFile = 16 << 20;  // bytes
  const auto text = ReadFileBytes(path, kMaxSceneFile);
  if (!text.ok()) return text.status();
  return ParseSceneFile(*text, path);
}

}  // namespace treelight::client
