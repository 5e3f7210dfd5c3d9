#include "client/scenes/hall.h"

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "client/scenes/shapes.h"
#include "client/scenes/smooth_normals.h"
#include "client/scenes/vector.h"

namespace treelight::client {
namespace {

// Indices of the materials, in the order in which MakeHall lists them.
enum : std::uint32_t { kStone, kColumn, kLightTile, kDarkTile, kCarpet, kLead, kDaylight, kGlow };

// The plan, metres: z along the nave, x across; half of what is symmetric.
constexpr int kBays = 10;
constexpr float kBay = 3, kHalfLength = kBay * kBays / 2;
constexpr float kNave = 4, kWall = 0.4f;  // middle of the arcade wall, half its thickness
constexpr float kAisle = 7.5f;            // the outer wall
constexpr float kSpring = 4.4f, kArchRadius = 1.1f;
constexpr float kAisleCeiling = 6.2f, kVaultSpring = 10.5f;
constexpr float kVaultRadius = kNave - kWall;
constexpr int kArchParts = 24, kVaultParts = 64, kColumnSegments = 48;

/// A point of a half circle in the plane of x or z, t in [0, 1] from one end over the top.
struct ArcPoint {
  float along = 0, up = 0;
};
ArcPoint OnArc(float radius, int i, int count) {
  if (i == 0 || i == count) return {i == 0 ? -radius : radius, 0};
  const double angle = std::numbers::pi * i / count;
  return {static_cast<float>(-radius * std::cos(angle)),
          static_cast<float>(radius * std::sin(angle))};
}

/// A quad whose front does not matter: both sides of stone are alike.
void AddStone(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, Mesh& mesh) {
  AddQuad(a, b, c, d, kStone, mesh);
}

/// One bay of the arcade at x, from z to z + kBay: two sheets with a round arch, and its soffit.
void AddArcadeBay(float x, float z, Mesh& mesh) {
  const float middle = z + kBay / 2;
  for (const float sheet : {x - kWall, x + kWall}) {
    // Piers on both sides of the arch; between them strips from the arch up.
    for (const float begin : {z, middle + kArchRadius}) {
      const float end = begin + kBay / 2 - kArchRadius;
      AddStone({sheet, kSpring, begin}, {sheet, kSpring, end}, {sheet, kVaultSpring, end},
               {sheet, kVaultSpring, begin}, mesh);
    }
    for (int i = 0; i < kArchParts; ++i) {
      const ArcPoint p = OnArc(kArchRadius, i, kArchParts),
                     q = OnArc(kArchRadius, i + 1, kArchParts);
      AddStone({sheet, kSpring + p.up, middle + p.along}, {sheet, kSpring + q.up, middle + q.along},
               {sheet, kVaultSpring, middle + q.along}, {sheet, kVaultSpring, middle + p.along},
               mesh);
    }
  }
  for (int i = 0; i < kArchParts; ++i) {
    const ArcPoint p = OnArc(kArchRadius, i, kArchParts), q = OnArc(kArchRadius, i + 1, kArchParts);
    AddStone({x - kWall, kSpring + p.up, middle + p.along},
             {x + kWall, kSpring + p.up, middle + p.along},
             {x + kWall, kSpring + q.up, middle + q.along},
             {x - kWall, kSpring + q.up, middle + q.along}, mesh);
  }
  // A string course above the arch.
  AddBox({x > 0 ? x - kWall : x + kWall, 6.6f, middle}, {0.24f, 0.2f, kBay}, 0, kStone, mesh);
}

/// A column with base, drum that tapers, and capital, from the floor to the arches.
void AddColumn(float x, float z, Mesh& mesh) {
  AddBox({x, 0.1f, z}, {1, 0.2f, 1}, 0, kColumn, mesh);
  std::vector<ProfilePoint> profile = {{0.48f, 0.2f}};
  for (int i = 0; i <= 6; ++i) {  // torus of the base
    const ArcPoint p = OnArc(0.1f, i, 6);
    profile.push_back({0.4f + p.up, 0.3f + p.along});
  }
  for (int i = 0; i <= 10; ++i) {  // drum, with entasis
    const float t = static_cast<float>(i) / 10;
    profile.push_back({0.36f - 0.06f * t * t, 0.42f + 3.18f * t});
  }
  for (int i = 0; i <= 8; ++i) {  // capital, an echinus
    const float t = static_cast<float>(i) / 8;
    profile.push_back({0.32f + 0.16f * t * t, 3.7f + 0.4f * t});
  }
  AddLathe({x, 0, z}, profile, kColumnSegments, kColumn, mesh);
  AddBox({x, 4.25f, z}, {1.05f, 0.3f, 1.05f}, 0, kColumn, mesh);
}

/// A window in a wall at x whose inside is towards -x * `sign`: a pane that shines, a frame and
/// lead bars before it.
void AddWindow(float x, float sign, float bottom, float top, float z, float width,
               std::uint32_t light, Mesh& mesh) {
  const float middle = (bottom + top) / 2, height = top - bottom;
  AddRectangle({x - sign * 0.02f, middle, z}, {-sign, 0, 0}, width, height, light, mesh);
  for (const float side : {-1.0f, 1.0f}) {
    AddBox({x - sign * 0.1f, middle, z + side * (width + 0.12f) / 2}, {0.2f, height + 0.24f, 0.12f},
           0, kStone, mesh);
    AddBox({x - sign * 0.1f, middle + side * (height + 0.12f) / 2, z}, {0.2f, 0.12f, width}, 0,
           kStone, mesh);
  }
  for (int i = 1; i < 4; ++i) {
    const float part = static_cast<float>(i) / 4 - 0.5f;
    AddBox({x - sign * 0.06f, middle, z + part * width}, {0.03f, height, 0.03f}, 0, kLead, mesh);
    AddBox({x - sign * 0.06f, middle + part * height, z}, {0.03f, 0.03f, width}, 0, kLead, mesh);
  }
}

/// The barrel vault of the nave, and a rib on it at every pair of columns.
void AddVault(Mesh& mesh) {
  constexpr int kRows = 2 * kBays;
  for (int row = 0; row < kRows; ++row) {
    const float z0 = -kHalfLength + kBay / 2 * static_cast<float>(row), z1 = z0 + kBay / 2;
    for (int i = 0; i < kVaultParts; ++i) {
      const ArcPoint p = OnArc(kVaultRadius, i, kVaultParts),
                     q = OnArc(kVaultRadius, i + 1, kVaultParts);
      AddStone({p.along, kVaultSpring + p.up, z0}, {q.along, kVaultSpring + q.up, z0},
               {q.along, kVaultSpring + q.up, z1}, {p.along, kVaultSpring + p.up, z1}, mesh);
    }
  }
  for (int bay = 0; bay <= kBays; ++bay) {
    std::vector<Vec3> rib;
    for (int i = 0; i <= kVaultParts; ++i) {
      const ArcPoint p = OnArc(kVaultRadius, i, kVaultParts);
      rib.push_back({p.along, kVaultSpring + p.up, -kHalfLength + kBay * static_cast<float>(bay)});
    }
    AddTube(rib, 0.16f, 10, kColumn, mesh);
  }
}

void AddFloor(Mesh& mesh) {
  const int across = static_cast<int>(2 * kAisle), along = static_cast<int>(2 * kHalfLength);
  for (int i = 0; i < across; ++i) {
    for (int k = 0; k < along; ++k) {
      AddRectangle(
          {-kAisle + 0.5f + static_cast<float>(i), 0, -kHalfLength + 0.5f + static_cast<float>(k)},
          {0, 1, 0}, 1, 1, (i + k) % 2 == 0 ? kLightTile : kDarkTile, mesh);
    }
  }
  AddBox({0, 0.01f, 0}, {1.8f, 0.02f, 2 * kHalfLength - 2}, 0, kCarpet, mesh);
}

/// The walls at both ends: the nave with the half circle of its vault, and the aisles.
void AddEnds(Mesh& mesh) {
  for (const float z : {-kHalfLength, kHalfLength}) {
    AddStone({-kAisle, 0, z}, {kAisle, 0, z}, {kAisle, kAisleCeiling, z},
             {-kAisle, kAisleCeiling, z}, mesh);
    AddStone({-kNave, kAisleCeiling, z}, {kNave, kAisleCeiling, z}, {kNave, kVaultSpring, z},
             {-kNave, kVaultSpring, z}, mesh);
    for (int i = 0; i < kVaultParts; ++i) {
      const ArcPoint p = OnArc(kVaultRadius, i, kVaultParts),
                     q = OnArc(kVaultRadius, i + 1, kVaultParts);
      AddStone({p.along, kVaultSpring, z}, {q.along, kVaultSpring, z},
               {q.along, kVaultSpring + q.up, z}, {p.along, kVaultSpring + p.up, z}, mesh);
    }
  }
}

void AddAisle(float sign, Mesh& mesh) {
  const float wall = sign * kAisle, arcade = sign * kNave;
  AddStone({wall, 0, -kHalfLength}, {wall, 0, kHalfLength}, {wall, kAisleCeiling, kHalfLength},
           {wall, kAisleCeiling, -kHalfLength}, mesh);
  AddStone({wall, kAisleCeiling, -kHalfLength}, {wall, kAisleCeiling, kHalfLength},
           {arcade, kAisleCeiling, kHalfLength}, {arcade, kAisleCeiling, -kHalfLength}, mesh);
  for (int bay = 0; bay < kBays; ++bay) {
    const float z = -kHalfLength + kBay * static_cast<float>(bay);
    AddArcadeBay(arcade, z, mesh);
    AddWindow(sign * (kNave - kWall), sign, 7.4f, 9.7f, z + kBay / 2, 1.2f, kDaylight, mesh);
    AddWindow(wall, sign, 2, 4.2f, z + kBay / 2, 0.8f, kGlow, mesh);
    AddColumn(arcade, z, mesh);
  }
  AddColumn(arcade, kHalfLength, mesh);
}

}  // namespace

Scene MakeHall() {
  Scene scene;
  scene.name = "hall";
  scene.materials = {
      {.name = "stone", .reflectance = {0.72f, 0.69f, 0.62f}},
      {.name = "column", .reflectance = {0.66f, 0.6f, 0.52f}},
      {.name = "light tile",
       .surface = Surface::kGlossy,
       .reflectance = {0.6f, 0.57f, 0.5f},
       .specular = {0.08f, 0.08f, 0.08f},
       .exponent = 80},
      {.name = "dark tile",
       .surface = Surface::kGlossy,
       .reflectance = {0.22f, 0.2f, 0.2f},
       .specular = {0.08f, 0.08f, 0.08f},
       .exponent = 80},
      {.name = "carpet", .reflectance = {0.5f, 0.07f, 0.06f}},
      {.name = "lead", .reflectance = {0.1f, 0.1f, 0.1f}},
      {.name = "daylight", .reflectance = {}, .emission = {4.4f, 4.7f, 5.4f}},
      {.name = "glow", .reflectance = {}, .emission = {2.6f, 1.9f, 1.1f}},
  };
  Mesh& mesh = scene.mesh;
  AddFloor(mesh);
  AddAisle(-1, mesh);
  AddAisle(1, mesh);
  AddVault(mesh);
  AddEnds(mesh);
  RemoveDegenerateTriangles(mesh);  // where arcs begin and end
  AddSmoothNormals(/*crease_degrees=*/25, mesh);
  scene.camera = {
      .position = {-1.2f, 1.8f, 13.6f}, .target = {0.2f, 4.4f, -4}, .vertical_fov_degrees = 62};
  return scene;
}

}  // namespace treelight::client
