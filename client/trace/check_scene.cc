#include "client/trace/check_scene.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "client/scenes/vector.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// By which the sum of two colours may be above 1.
constexpr float kRounding = 1e-5f;

absl::Status CheckMaterials(const Scene& scene) {
  for (const Material& material : scene.materials) {
    const auto check = [&](const char* field, const Rgb& color) {
      if (color.r >= 0 && color.g >= 0 && color.b >= 0 &&
          std::isfinite(color.r + color.g + color.b))
        return absl::OkStatus();
      return absl::InvalidArgumentError(
          fmt::format("material {}: {} {} {} {} is not a colour: each must be finite and >= 0",
                      material.name, field, color.r, color.g, color.b));
    };
    absl::Status status = check("reflectance", material.reflectance);
    status.Update(check("specular", material.specular));
    status.Update(check("transmittance", material.transmittance));
    status.Update(check("emission", material.emission));
    if (!status.ok()) return status;
    const float reflected =
        MaxChannel(material.surface == Surface::kGlossy ? material.reflectance + material.specular
                                                        : material.reflectance);
    const float most = std::max(reflected, MaxChannel(material.transmittance));
    if (most > 1 + kRounding) {
      return absl::InvalidArgumentError(fmt::format(
          "material {}: it gives {:g} times the light that it gets; reflectance and specular "
          "together, and transmittance, are at most 1 in each channel",
          material.name, most));
    }
    const bool refracts =
        material.surface == Surface::kDielectric || material.surface == Surface::kPane;
    if (refracts && !(material.ior > 0 && std::isfinite(material.ior))) {
      return absl::InvalidArgumentError(
          fmt::format("material {}: ior {} is not positive", material.name, material.ior));
    }
    if (material.surface == Surface::kGlossy &&
        !(material.exponent >= 0 && std::isfinite(material.exponent))) {
      return absl::InvalidArgumentError(fmt::format("material {}: exponent {} is not a number >= 0",
                                                    material.name, material.exponent));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckMesh(const Scene& scene) {
  const Mesh& mesh = scene.mesh;
  if (mesh.materials.size() != mesh.corners.size()) {
    return absl::InvalidArgumentError(fmt::format("mesh has {} triangles but {} materials",
                                                  mesh.corners.size(), mesh.materials.size()));
  }
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.vertices.size()) {
    return absl::InvalidArgumentError(fmt::format("mesh has {} vertices but {} normals",
                                                  mesh.vertices.size(), mesh.normals.size()));
  }
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) {
    for (const std::uint32_t corner : mesh.corners[i]) {
      if (corner >= mesh.vertices.size()) {
        return absl::InvalidArgumentError(
            fmt::format("triangle {}: there is no vertex {}", i, corner));
      }
    }
    if (mesh.materials[i] >= scene.materials.size()) {
      return absl::InvalidArgumentError(
          fmt::format("triangle {}: there is no material {}", i, mesh.materials[i]));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckSpheres(const Scene& scene) {
  for (std::size_t i = 0; i < scene.spheres.size(); ++i) {
    const Sphere& sphere = scene.spheres[i];
    if (sphere.material >= scene.materials.size()) {
      return absl::InvalidArgumentError(
          fmt::format("sphere {}: there is no material {}", i, sphere.material));
    }
    if (!(sphere.radius > 0)) {
      return absl::InvalidArgumentError(
          fmt::format("sphere {}: radius {} is not positive", i, sphere.radius));
    }
    if (MaxChannel(scene.materials[sphere.material].emission) > 0) {
      return absl::InvalidArgumentError(fmt::format("sphere {} emits; only triangles may", i));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckPointLights(const Scene& scene) {
  for (std::size_t i = 0; i < scene.point_lights.size(); ++i) {
    const PointLight& light = scene.point_lights[i];
    if (!(light.cone_degrees > 0 && light.cone_degrees <= 180)) {
      return absl::InvalidArgumentError(
          fmt::format("point light {}: cone_degrees {} is not in (0, 180]", i, light.cone_degrees));
    }
    if (!(light.falloff_begin_degrees >= 0 && light.falloff_begin_degrees <= light.cone_degrees)) {
      return absl::InvalidArgumentError(fmt::format(
          "point light {}: falloff_begin_degrees {} is not between 0 and cone_degrees, {}", i,
          light.falloff_begin_degrees, light.cone_degrees));
    }
    if (!(std::fabs(Dot(light.direction, light.direction) - 1) < 1e-3f)) {
      return absl::InvalidArgumentError(fmt::format(
          "point light {}: the length of its direction is {}, not 1", i, Length(light.direction)));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckScene(const Scene& scene) {
  absl::Status status = CheckMaterials(scene);
  if (status.ok()) status = CheckMesh(scene);
  if (status.ok()) status = CheckSpheres(scene);
  if (status.ok()) status = CheckPointLights(scene);
  return status;
}

}  // namespace treelight::client
