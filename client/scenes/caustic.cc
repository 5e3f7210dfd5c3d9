#include "client/scenes/caustic.h"

#include <array>

#include "client/scenes/shapes.h"
#include "client/scenes/smooth_normals.h"
#include "client/scenes/vector.h"

namespace treelight::client {
namespace {

// Indices of the materials, in the order in which MakeCaustic lists them.
enum : std::uint32_t { kFloor, kMetal, kGlass, kLamp, kSky };

constexpr float kRingRadius = 0.6f, kRingHeight = 0.25f, kRingThickness = 0.03f;
constexpr int kRingSegments = 1024;  // a facet is 4 mm wide; its normals are the cylinder's
constexpr float kSphereRadius = 0.3f;
// Air below the ring and the sphere, so that the offset of rays does not carry them through the
// floor.
constexpr float kGap = 0.001f;
constexpr Vec3 kLampPosition = {0, 1.6f, 2.4f};
constexpr float kLampSide = 0.2f;

}  // namespace

Scene MakeCaustic() {
  Scene scene;
  scene.name = "caustic";
  scene.materials = {
      {.name = "floor", .reflectance = {0.62f, 0.6f, 0.57f}},
      {.name = "metal", .surface = Surface::kMirror, .reflectance = {0.95f, 0.79f, 0.48f}},
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f},
      {.name = "lamp", .reflectance = {}, .emission = {270, 255, 230}},
      {.name = "sky", .reflectance = {}, .emission = {0.25f, 0.3f, 0.4f}},
  };
  Mesh& mesh = scene.mesh;
  // Up the outer wall, over the rim, down the inner wall and back: closed.
  constexpr float kInner = kRingRadius, kOuter = kRingRadius + kRingThickness;
  const std::array<ProfilePoint, 5> ring = {
      {{kOuter, 0}, {kOuter, kRingHeight}, {kInner, kRingHeight}, {kInner, 0}, {kOuter, 0}}};
  AddLathe({0, kGap, 0}, ring, kRingSegments, kMetal, mesh);
  AddSmoothNormals(/*crease_degrees=*/30, mesh);
  AddRectangle({0, 0, 0}, {0, 1, 0}, 8, 8, kFloor, mesh);
  AddRectangle(kLampPosition, Normalize(-kLampPosition), kLampSide, kLampSide, kLamp, mesh);
  AddRectangle({0, 6, 0}, {0, -1, 0}, 8, 8, kSky, mesh);
  scene.spheres = {{.center = {1.05f, kSphereRadius + kGap, -0.15f},
                    .radius = kSphereRadius,
                    .material = kGlass}};
  scene.camera = {
      .position = {0.9f, 2.1f, 1.9f}, .target = {0.28f, 0, -0.1f}, .vertical_fov_degrees = 44};
  return scene;
}

}  // namespace treelight::client
