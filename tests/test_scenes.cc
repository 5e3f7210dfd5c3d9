#include "tests/test_scenes.h"

#include <utility>

namespace treelight::testing {

using client::AddQuad;
using client::Material;
using client::Scene;

Scene MakeClosedBox(const Material& wall) {
  Scene scene;
  scene.name = "box";
  scene.materials = {wall};
  const Vec3 c[] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                    {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  const int quads[6][4] = {{0, 1, 2, 3}, {5, 4, 7, 6}, {4, 0, 3, 7},
                           {1, 5, 6, 2}, {4, 5, 1, 0}, {3, 2, 6, 7}};
  for (const auto& q : quads) AddQuad(c[q[0]], c[q[1]], c[q[2]], c[q[3]], 0, scene.mesh);
  scene.camera = {
      .position = {0.5f, 0.5f, 0.95f}, .target = {0.5f, 0.5f, 0}, .vertical_fov_degrees = 60};
  return scene;
}

Scene MakeFurnace(float albedo, float emission) {
  return MakeClosedBox({.name = "wall",
                        .reflectance = {albedo, albedo, albedo},
                        .emission = {emission, emission, emission}});
}

Scene MakeDiffuseBox() {
  Scene scene = MakeClosedBox({.name = "grey", .reflectance = {0.5f, 0.6f, 0.7f}});
  scene.materials.push_back({.name = "lamp", .reflectance = {}, .emission = {10, 8, 6}});
  AddQuad({0.3f, 0.99f, 0.3f}, {0.7f, 0.99f, 0.3f}, {0.7f, 0.99f, 0.7f}, {0.3f, 0.99f, 0.7f}, 1,
          scene.mesh);
  return scene;
}

Scene MakeLampOverFloor(float radiance, float side) {
  Scene scene;
  scene.name = "lamp";
  scene.materials = {
      {.name = "floor", .reflectance = {0.5f, 0.5f, 0.5f}},
      {.name = "lamp", .reflectance = {}, .emission = {radiance, radiance, radiance}}};
  AddQuad({-10, 0, 10}, {10, 0, 10}, {10, 0, -10}, {-10, 0, -10}, 0, scene.mesh);
  const float h = side / 2;
  AddQuad({-h, 1, -h}, {h, 1, -h}, {h, 1, h}, {-h, 1, h}, 1, scene.mesh);
  scene.camera = {.position = {0.001f, 0.5f, 0}, .target = {0, 0, 0}, .vertical_fov_degrees = 1};
  return scene;
}

Scene MakeLampUnderMirror(float radiance, float side) {
  Scene scene = MakeLampOverFloor(radiance, side);
  for (const int triangle : {2, 3}) {
    auto& corners = scene.mesh.corners[triangle];
    std::swap(corners[1], corners[2]);
  }
  scene.materials.push_back(
      {.name = "mirror", .surface = client::Surface::kMirror, .reflectance = {1, 1, 1}});
  AddQuad({-50, 2, -50}, {50, 2, -50}, {50, 2, 50}, {-50, 2, 50}, 2, scene.mesh);
  scene.camera.target = {1.5f, 0, 0};
  return scene;
}

client::Intersector MustIntersect(Scene scene) {
  auto intersector = client::Intersector::Create(std::move(scene));
  return *std::move(intersector);  // aborts with the status where there is none
}

}  // namespace treelight::testing
