#include "client/scenes/scene.h"

namespace treelight::client {

void AddQuad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, std::uint32_t material,
             Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {a, b, c, d});
  if (!mesh.normals.empty()) mesh.normals.resize(mesh.vertices.size());
  mesh.corners.push_back({first, first + 1, first + 2});
  mesh.corners.push_back({first, first + 2, first + 3});
  mesh.materials.insert(mesh.materials.end(), {material, material});
}

void MakeDiffuse(float reflectance, Scene& scene) {
  for (Material& material : scene.materials) {
    material.surface = Surface::kDiffuse;
    material.reflectance = {reflectance, reflectance, reflectance};
  }
}

}  // namespace treelight::client
