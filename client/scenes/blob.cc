#include "client/scenes/blob.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "client/scenes/shapes.h"
#include "client/scenes/smooth_normals.h"
#include "client/scenes/vector.h"

namespace treelight::client {
namespace {

// Indices of the materials, in the order in which MakeBlob lists them.
enum : std::uint32_t { kGround, kBody, kLamp, kSky };

constexpr int kDivisions = 100;  // of the edges of an icosahedron: 20 * 100^2 triangles

using Point = std::array<double, 3>;

constexpr double kGolden = 1.618033988749895;
constexpr std::array<Point, 12> kCorners = {{{-1, kGolden, 0},
                                             {1, kGolden, 0},
                                             {-1, -kGolden, 0},
                                             {1, -kGolden, 0},
                                             {0, -1, kGolden},
                                             {0, 1, kGolden},
                                             {0, -1, -kGolden},
                                             {0, 1, -kGolden},
                                             {kGolden, 0, -1},
                                             {kGolden, 0, 1},
                                             {-kGolden, 0, -1},
                                             {-kGolden, 0, 1}}};
constexpr std::array<std::array<int, 3>, 20> kFaces = {
    {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
     {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
     {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};

/// Where a direction of the sphere goes: waves on three scales, the finer ones bent by the coarser,
/// so that the surface folds without meeting itself.
Vec3 Displace(Point d) {
  const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (double& x : d) x /= length;
  const double coarse = std::sin(2.3 * d[0] + 0.4) * std::sin(2.9 * d[1] - 0.7) +
                        0.6 * std::sin(3.1 * d[2] + 1.9 * d[0]);
  const double middle = std::sin(6.1 * d[0] + 2.2 * coarse) * std::sin(5.3 * d[1] + 1.1) *
                        std::sin(5.7 * d[2] - 0.3 + 1.4 * coarse);
  const double fine = std::sin(19 * d[0] + 4 * middle) * std::sin(17 * d[1] - 3 * middle) *
                      std::sin(18 * d[2] + 2 * coarse);
  const double radius = 1 + 0.23 * coarse + 0.22 * middle + 0.035 * fine;
  return {static_cast<float>(1.25 * radius * d[0]), static_cast<float>(radius * d[1]),
          static_cast<float>(radius * d[2])};
}

/// Point (i, j) of a divided face, 0 <= i + j <= kDivisions. Corners are added in the order of
/// their indices, so that the faces on both sides of an edge compute the same bits.
Vec3 PointOfFace(const std::array<int, 3>& face, int i, int j) {
  std::array<std::pair<int, int>, 3> weights = {
      {{face[0], kDivisions - i - j}, {face[1], i}, {face[2], j}}};
  std::sort(weights.begin(), weights.end());
  Point sum{};
  for (const auto& [corner, weight] : weights) {
    for (int axis = 0; axis < 3; ++axis) sum[axis] += weight * kCorners[corner][axis];
  }
  return Displace(sum);
}

void AddBody(Mesh& mesh) {
  for (const auto& face : kFaces) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    // Row i begins behind the kDivisions + 1, kDivisions, ... points of the rows before it.
    const auto at = [first](int i, int j) {
      return first + static_cast<std::uint32_t>(i * (kDivisions + 1) - i * (i - 1) / 2 + j);
    };
    for (int i = 0; i <= kDivisions; ++i) {
      for (int j = 0; i + j <= kDivisions; ++j) mesh.vertices.push_back(PointOfFace(face, i, j));
    }
    for (int i = 0; i < kDivisions; ++i) {
      for (int j = 0; i + j < kDivisions; ++j) {
        mesh.corners.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (i + j + 1 < kDivisions)
          mesh.corners.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  mesh.materials.resize(mesh.corners.size(), kBody);
  WeldVertices(mesh);
}

}  // namespace

Scene MakeBlob() {
  Scene scene;
  scene.name = "blob";
  scene.materials = {
      {.name = "ground", .reflectance = {0.5f, 0.48f, 0.45f}},
      {.name = "body",
       .surface = Surface::kGlossy,
       .reflectance = {0.55f, 0.24f, 0.12f},
       .specular = {0.12f, 0.12f, 0.12f},
       .exponent = 60},
      {.name = "lamp", .reflectance = {}, .emission = {26, 24, 21}},
      {.name = "sky", .reflectance = {}, .emission = {1.6f, 2, 2.6f}},
  };
  Mesh& mesh = scene.mesh;
  AddBody(mesh);
  float lowest = 0;
  for (const Vec3& vertex : mesh.vertices) lowest = std::min(lowest, vertex.y);
  for (Vec3& vertex : mesh.vertices) vertex.y -= lowest - 0.001f;  // a millimetre of air
  AddSmoothNormals(/*crease_degrees=*/80, mesh);
  AddRectangle({0, 0, 0}, {0, 1, 0}, 16, 16, kGround, mesh);
  AddRectangle({-3, 5, 2.5f}, Normalize({3, -4, -2.5f}), 1.6f, 1.6f, kLamp, mesh);
  AddRectangle({4.5f, 3.5f, 1.5f}, Normalize({-4.5f, -2.5f, -1.5f}), 2, 2, kSky, mesh);
  scene.camera = {
      .position = {1.2f, 2.4f, 4.6f}, .target = {0, 0.95f, 0}, .vertical_fov_degrees = 38};
  return scene;
}

}  // namespace treelight::client
