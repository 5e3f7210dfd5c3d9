#include "client/scenes/cornell.h"

namespace treelight::client {
namespace {

// Indices of the materials, in the order in which MakeCornell lists them.
enum : std::uint32_t { kWhite, kRed, kGreen, kLight, kMirror, kGlass };

constexpr float kLightHalfWidth = 0.25f;
constexpr float kSphereRadius = 0.35f;
// A millimetre of air below the spheres: the offset that keeps a ray off the surface that it leaves
// must not carry it through the floor.
constexpr float kSphereHeight = kSphereRadius + 0.001f;

/// The ceiling around the light: four trapezoids that share the corners of both, so there is no
/// T-junction for a ray to slip through.
void AddCeiling(Mesh& mesh) {
  constexpr float w = kLightHalfWidth;
  const Vec3 outer[4] = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}};
  const Vec3 inner[4] = {{-w, 2, -w}, {w, 2, -w}, {w, 2, w}, {-w, 2, w}};
  for (int i = 0; i < 4; ++i) {
    const int j = (i + 1) % 4;
    AddQuad(outer[i], outer[j], inner[j], inner[i], kWhite, mesh);
  }
  AddQuad(inner[0], inner[1], inner[2], inner[3], kLight, mesh);
}

}  // namespace

Scene MakeCornell() {
  Scene scene;
  scene.name = "cornell";
  scene.materials = {
      {.name = "white", .reflectance = {0.73f, 0.72f, 0.70f}},
      {.name = "red", .reflectance = {0.63f, 0.065f, 0.05f}},
      {.name = "green", .reflectance = {0.14f, 0.45f, 0.091f}},
      {.name = "light", .reflectance = {}, .emission = {18, 15, 11}},
      {.name = "mirror", .surface = Surface::kMirror, .reflectance = {0.95f, 0.95f, 0.95f}},
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f},
  };
  Mesh& mesh = scene.mesh;
  AddQuad({-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}, kWhite, mesh);    // floor
  AddQuad({-1, 0, -1}, {1, 0, -1}, {1, 2, -1}, {-1, 2, -1}, kWhite, mesh);  // back wall
  AddQuad({-1, 0, 1}, {-1, 0, -1}, {-1, 2, -1}, {-1, 2, 1}, kRed, mesh);    // left wall
  AddQuad({1, 0, -1}, {1, 0, 1}, {1, 2, 1}, {1, 2, -1}, kGreen, mesh);      // right wall
  AddCeiling(mesh);
  scene.spheres = {
      {.center = {-0.42f, kSphereHeight, -0.38f}, .radius = kSphereRadius, .material = kMirror},
      {.center = {0.42f, kSphereHeight, 0.28f}, .radius = kSphereRadius, .material = kGlass},
  };
  scene.camera = {.position = {0, 1, 3.9f}, .target = {0, 1, 0}, .vertical_fov_degrees = 38.5f};
  return scene;
}

}  // namespace treelight::client
