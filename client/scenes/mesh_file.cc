#include "client/scenes/mesh_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "client/scenes/assimp_mesh.h"
#include "client/scenes/file_bytes.h"
#include "client/scenes/ply_mesh.h"
#include "client/scenes/smooth_normals.h"
#include "client/scenes/vector.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

enum class Format { kNone, kObj, kPly, kGltf };

Format FormatOf(std::string_view path) {
  if (path.ends_with(".xz")) path.remove_suffix(3);
  std::string ending(path.substr(std::min(path.find_last_of('.'), path.size())));
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".obj") return Format::kObj;
  if (ending == ".ply") return Format::kPly;
  if (ending == ".gltf" || ending == ".glb") return Format::kGltf;
  return Format::kNone;
}

absl::StatusOr<MeshFile> ReadPly(std::string_view bytes, const std::string& path) {
  auto mesh = ParsePlyMesh(bytes, path);
  if (!mesh.ok()) return mesh.status();
  MeshFile file;
  file.materials = {{.name = "default", .reflectance = {0.7f, 0.7f, 0.7f}}};
  file.mesh = *std::move(mesh);
  return file;
}

absl::StatusOr<MeshFile> ReadRaw(std::string bytes, const std::string& path) {
  switch (FormatOf(path)) {
    case Format::kObj:
      return ReadObj(bytes, path);
    case Format::kPly:
      return ReadPly(bytes, path);
    case Format::kGltf:
      return ReadGltf(std::move(bytes), path);
    case Format::kNone:
      break;
  }
  return absl::InvalidArgumentError(fmt::format(
      "{}: no mesh that is read, its name ends in none of .obj, .ply, .gltf, .glb, nor these with "
      ".xz",
      path));
}

/// `status` with its message on one printable line: it may quote what the file has. The path stays.
absl::Status OneLine(const absl::Status& status, const std::string& path) {
  std::string message(status.message());
  for (std::size_t i = message.starts_with(path) ? path.size() : 0; i < message.size(); ++i) {
    if (message[i] < ' ' || message[i] > '~') message[i] = '?';
  }
  return absl::Status(status.code(), message);
}

/// Leaves out the triangles of materials of these names.
absl::Status DropMaterials(const std::vector<std::string>& names, const std::string& path,
                           MeshFile& file) {
  for (const std::string& name : names) {
    std::vector<std::string> there;
    for (const Material& material : file.materials) there.push_back(material.name);
    if (std::find(there.begin(), there.end(), name) == there.end()) {
      return absl::InvalidArgumentError(fmt::format("{}: it has no material \"{}\"; it has: {}",
                                                    path, name, fmt::join(there, ", ")));
    }
  }
  Mesh& mesh = file.mesh;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) {
    const std::string& name = file.materials[mesh.materials[i]].name;
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    mesh.corners[kept] = mesh.corners[i];
    mesh.materials[kept] = mesh.materials[i];
    ++kept;
  }
  mesh.corners.resize(kept);
  mesh.materials.resize(kept);
  return absl::OkStatus();
}

/// Takes out the materials that no triangle has: Assimp adds some of its own.
void RemoveUnusedMaterials(MeshFile& file) {
  std::vector<bool> used(file.materials.size());
  for (const std::uint32_t material : file.mesh.materials) used[material] = true;
  std::vector<std::uint32_t> moved(file.materials.size());
  std::vector<Material> kept;
  for (std::size_t i = 0; i < used.size(); ++i) {
    moved[i] = static_cast<std::uint32_t>(kept.size());
    if (used[i]) kept.push_back(std::move(file.materials[i]));
  }
  for (std::uint32_t& material : file.mesh.materials) material = moved[material];
  file.materials = std::move(kept);
}

/// Makes all normals unit; those that have no direction become (0, 0, 0).
void NormalizeNormals(Mesh& mesh) {
  for (Vec3& normal : mesh.normals) {
    const float length = Length(normal);
    normal = std::isfinite(length) && length > 1e-20f ? (1 / length) * normal : Vec3{};
  }
}

}  // namespace

bool IsMeshPath(std::string_view path) { return FormatOf(path) != Format::kNone; }

absl::StatusOr<MeshFile> ParseMesh(std::string bytes, const std::string& path,
                                   const MeshFileOptions& options) {
  auto file = ReadRaw(std::move(bytes), path);
  if (!file.ok()) return OneLine(file.status(), path);
  if (auto status = DropMaterials(options.dropped_materials, path, *file); !status.ok())
    return status;
  Mesh& mesh = file->mesh;
  file->degenerate_count = RemoveDegenerateTriangles(mesh);
  if (mesh.corners.empty())
    return absl::InvalidArgumentError(fmt::format("{}: it has no triangle with an area", path));
  if (file->degenerate_count > 0) {
    file->notes.push_back(
        fmt::format("{}: {} triangles without area are left out", path, file->degenerate_count));
  }
  RemoveUnusedMaterials(*file);
  if (options.normals == Normals::kFile) {
    NormalizeNormals(mesh);
  } else {
    mesh.normals.clear();
  }
  WeldVertices(mesh);
  if (options.normals != Normals::kFlat) AddSmoothNormals(options.crease_degrees, mesh);
  return file;
}

absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path, const MeshFileOptions& options) {
  if (!IsMeshPath(path)) return ReadRaw({}, path).status();
  auto bytes = ReadFileBytes(path);
  if (!bytes.ok()) return bytes.status();
  return ParseMesh(*std::move(bytes), path, options);
}

}  // namespace treelight::client
