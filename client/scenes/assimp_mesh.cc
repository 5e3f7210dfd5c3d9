#include "client/scenes/assimp_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "assimp/IOStream.hpp"
#include "assimp/IOSystem.hpp"
#include "assimp/Importer.hpp"
#include "assimp/MemoryIOWrapper.h"
#include "assimp/postprocess.h"
#include "assimp/scene.h"
#include "client/scenes/file_bytes.h"
#include "client/scenes/gltf_check.h"
#include "client/scenes/mesh_material.h"
#include "client/scenes/obj_text.h"
#include "core/model/photons.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

using Files = std::map<std::string, std::string, std::less<>>;  // bytes by name

/// The file that is read and what it refers to, in memory; Assimp opens nothing else.
class MemoryFiles : public Assimp::IOSystem {
 public:
  explicit MemoryFiles(const Files& files) : files_(files) {}

  bool Exists(const char* name) const override { return files_.contains(Plain(name)); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* name, const char* /*mode*/) override {
    const auto file = files_.find(Plain(name));
    if (file == files_.end()) return nullptr;
    return std::make_unique<Assimp::MemoryIOStream>(
               reinterpret_cast<const std::uint8_t*>(file->second.data()), file->second.size())
        .release();  // comes back to Close
  }
  void Close(Assimp::IOStream* stream) override { std::unique_ptr<Assimp::IOStream>{stream}; }

 private:
  static std::string Plain(std::string_view name) {
    while (name.starts_with("./")) name.remove_prefix(2);
    return std::string(name);
  }
  const Files& files_;
};

absl::Status AssimpError(const std::string& path, std::string_view error) {
  return absl::InvalidArgumentError(fmt::format("{}: {}", path, error.substr(0, 200)));
}

/// Appends one of Assimp's meshes; what is no triangle is passed over.
absl::Status AppendMesh(const aiMesh& source, const aiMatrix4x4& transform, const std::string& path,
                        Mesh& mesh) {
  // Normals go with the inverse transpose; a mirrored mesh is turned inside out.
  aiMatrix3x3 linear(transform);
  const bool mirrored = linear.Determinant() < 0;
  const aiMatrix3x3 normal_transform =
      linear.Determinant() != 0 ? aiMatrix3x3(linear).Inverse().Transpose() : aiMatrix3x3();
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (unsigned i = 0; i < source.mNumVertices; ++i) {
    const aiVector3D p = transform * source.mVertices[i];
    for (const float x : {p.x, p.y, p.z}) {
      if (!(std::fabs(x) <= kMaxCoordinate)) {
        return absl::InvalidArgumentError(
            fmt::format("{}: mesh '{}', vertex {}: ({}, {}, {}) is not finite and within {:g}",
                        path, source.mName.C_Str(), i, p.x, p.y, p.z, kMaxCoordinate));
      }
    }
    mesh.vertices.push_back({p.x, p.y, p.z});
    aiVector3D n = source.HasNormals() ? normal_transform * source.mNormals[i] : aiVector3D();
    const float length = n.Length();
    n = std::isfinite(length) && length > 0 ? n / length : aiVector3D();
    mesh.normals.push_back({n.x, n.y, n.z});
  }
  for (unsigned i = 0; i < source.mNumFaces; ++i) {
    const aiFace& face = source.mFaces[i];
    if (face.mNumIndices != 3) continue;
    std::array<std::uint32_t, 3> corners{};
    for (int k = 0; k < 3; ++k) {
      if (face.mIndices[k] >= source.mNumVertices) {
        return absl::InvalidArgumentError(
            fmt::format("{}: mesh '{}', triangle {}: vertex {}: there are {}", path,
                        source.mName.C_Str(), i, face.mIndices[k], source.mNumVertices));
      }
      corners[k] = first + face.mIndices[k];
    }
    if (mirrored) std::swap(corners[1], corners[2]);
    mesh.corners.push_back(corners);
    mesh.materials.push_back(source.mMaterialIndex);
  }
  return absl::OkStatus();
}

/// All meshes of the scene, each as often and where its nodes say.
absl::StatusOr<Mesh> ConvertMeshes(const aiScene& scene, const std::string& path) {
  Mesh mesh;
  std::vector<std::pair<const aiNode*, aiMatrix4x4>> nodes = {{scene.mRootNode, aiMatrix4x4()}};
  while (!nodes.empty()) {
    const auto [node, parent] = nodes.back();
    nodes.pop_back();
    const aiMatrix4x4 transform = parent * node->mTransformation;
    for (unsigned i = 0; i < node->mNumMeshes; ++i) {
      const aiMesh& source = *scene.mMeshes[node->mMeshes[i]];
      if (mesh.corners.size() + source.mNumFaces > kMaxTriangles) {
        return absl::ResourceExhaustedError(
            fmt::format("{}: more than {} triangles, which is the limit", path, kMaxTriangles));
      }
      if (auto status = AppendMesh(source, transform, path, mesh); !status.ok()) return status;
    }
    for (unsigned i = node->mNumChildren; i > 0; --i)
      nodes.emplace_back(node->mChildren[i - 1], transform);
  }
  return mesh;
}

constexpr std::size_t kMaxNamed = 5;  // materials in one line

absl::StatusOr<MeshFile> Import(const std::string& name, const Files& files,
                                TranslatedMaterial (*translate)(const aiMaterial&),
                                const std::string& path) {
  Assimp::Importer importer;
  importer.SetIOHandler(std::make_unique<MemoryFiles>(files).release());  // owns it
  // Points and lines are passed over.
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* const scene = importer.ReadFile(name, aiProcess_Triangulate);
  if (scene == nullptr || scene->mRootNode == nullptr)
    return AssimpError(path, importer.GetErrorString());
  MeshFile file;
  auto mesh = ConvertMeshes(*scene, path);
  if (!mesh.ok()) return mesh.status();
  file.mesh = *std::move(mesh);
  std::vector<std::string> scaled;
  for (unsigned i = 0; i < scene->mNumMaterials; ++i) {
    auto translated = translate(*scene->mMaterials[i]);
    if (translated.scaled) scaled.push_back(fmt::format("\"{}\"", translated.material.name));
    file.materials.push_back(std::move(translated.material));
  }
  if (!scaled.empty()) {
    file.notes.push_back(fmt::format(
        "{}: materials would reflect more light than they get and are "
        "scaled down: {}{}",
        path,
        fmt::join(scaled.begin(),
                  scaled.begin() + std::min<std::ptrdiff_t>(scaled.size(), kMaxNamed), ", "),
        scaled.size() > kMaxNamed ? fmt::format(" and {} more", scaled.size() - kMaxNamed) : ""));
  }
  return file;
}

std::string FolderOf(const std::string& path) {
  const std::size_t slash = path.find_last_of('/');
  return slash == path.npos ? "" : path.substr(0, slash + 1);
}

/// The name of `path` without its folder and without .xz.
std::string PlainName(const std::string& path) {
  std::string name = path.substr(FolderOf(path).size());
  if (name.ends_with(".xz")) name.resize(name.size() - 3);
  return name;
}

/// Reads `name` of `folder`, or else `name`.xz.
absl::StatusOr<std::string> ReadBeside(const std::string& folder, const std::string& name) {
  const std::string path = name.starts_with('/') ? name : folder + name;
  auto bytes = ReadFileBytes(path);
  if (bytes.ok() || !absl::IsNotFound(bytes.status())) return bytes;
  auto unpacked = ReadFileBytes(path + ".xz");
  if (unpacked.ok() || !absl::IsNotFound(unpacked.status())) return unpacked;
  return bytes;
}

}  // namespace

absl::StatusOr<MeshFile> ReadObj(std::string_view bytes, const std::string& path) {
  auto obj = CheckObj(bytes, path);
  if (!obj.ok()) return obj.status();
  Files files;
  std::vector<std::string> notes;
  std::set<std::string, std::less<>> known = {"DefaultMaterial"};
  for (const auto& [line, library] : obj->libraries) {
    std::string name = library;
    std::replace(name.begin(), name.end(), '\\', '/');
    auto text = ReadBeside(FolderOf(path), name);
    if (absl::IsNotFound(text.status())) {
      notes.push_back(fmt::format("{}:{}: there is no material file \"{}\"; its materials are grey",
                                  path, line, library));
      continue;
    }
    if (!text.ok()) return text.status();
    const auto names = CheckMtl(*text, FolderOf(path) + name);
    if (!names.ok()) return names.status();
    known.insert(names->begin(), names->end());
    files[library] = *std::move(text);
  }
  for (const auto& [line, material] : obj->materials) {
    if (!known.contains(material) && !files.empty()) {
      notes.push_back(fmt::format("{}:{}: material \"{}\" is in no material file; it is grey", path,
                                  line, material));
    }
  }
  const std::string name = PlainName(path);
  files[name] = std::move(obj->text);
  auto file = Import(name, files, TranslateMtl, path);
  if (!file.ok()) return file;
  file->notes.insert(file->notes.begin(), notes.begin(), notes.end());
  if (file->mesh.corners.size() < obj->triangle_count) {
    file->notes.push_back(
        fmt::format("{}: {} of {} triangles are left out: polygons that cross themselves", path,
                    obj->triangle_count - file->mesh.corners.size(), obj->triangle_count));
  }
  return file;
}

absl::StatusOr<MeshFile> ReadGltf(std::string bytes, const std::string& path) {
  const auto buffers = CheckGltf(bytes, path);
  if (!buffers.ok()) return buffers.status();
  Files files;
  for (const std::string& name : *buffers) {
    auto buffer = ReadBeside(FolderOf(path), name);
    if (!buffer.ok()) {
      return absl::Status(
          buffer.status().code(),
          fmt::format("{}: buffer: {}", path, std::string(buffer.status().message())));
    }
    files[name] = *std::move(buffer);
  }
  const std::string name = PlainName(path);
  files[name] = std::move(bytes);
  return Import(name, files, TranslateGltf, path);
}

}  // namespace treelight::client
