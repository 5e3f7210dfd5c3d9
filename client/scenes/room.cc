#include "client/scenes/room.h"

#include <array>
#include <cmath>
#include <numbers>

#include "client/scenes/shapes.h"
#include "client/scenes/smooth_normals.h"
#include "client/scenes/vector.h"

namespace treelight::client {
namespace {

// Indices of the materials, in the order in which MakeRoom lists them.
enum : std::uint32_t {
  kWall,
  kFloor,
  kCeiling,
  kWood,
  kDarkWood,
  kCloth,
  kChrome,
  kBoard,
  kBlack,
  kGlass,
  kLamp,
  kFirstBook  // and the kBookColors - 1 behind it
};

constexpr float kHalfWidth = 5.5f, kHalfDepth = 3.5f, kHeight = 2.7f;  // x, z, y, metres
constexpr std::array<Rgb, 6> kBookColors = {{{0.45f, 0.08f, 0.06f},
                                             {0.08f, 0.16f, 0.4f},
                                             {0.1f, 0.32f, 0.14f},
                                             {0.6f, 0.48f, 0.16f},
                                             {0.5f, 0.47f, 0.42f},
                                             {0.16f, 0.13f, 0.12f}}};

/// Numbers in [0, 1) that look random and are the same everywhere (Steele, Lea and Flood 2014,
/// SplitMix64).
class Sequence {
 public:
  float Next() {
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return static_cast<float>((z ^ (z >> 31)) >> 40) * 0x1p-24f;
  }

 private:
  std::uint64_t state_ = 1;
};

/// Places the parts of a piece of furniture that stands at `place`, turned by `turn` about the
/// vertical.
class Furniture {
 public:
  Furniture(const Vec3& place, float turn, Mesh& mesh) : place_(place), turn_(turn), mesh_(mesh) {}

  Vec3 At(const Vec3& p) const {
    const float c = std::cos(turn_), s = std::sin(turn_);
    return place_ + Vec3{c * p.x + s * p.z, p.y, c * p.z - s * p.x};
  }
  void Box(const Vec3& center, const Vec3& size, std::uint32_t material) {
    AddBox(At(center), size, turn_, material, mesh_);
  }
  void Tube(std::vector<Vec3> corners, float radius, float rounding, std::uint32_t material) {
    for (Vec3& corner : corners) corner = At(corner);
    AddTube(RoundedPath(corners, rounding, 12), radius, 12, material, mesh_);
  }

 private:
  Vec3 place_;
  float turn_;
  Mesh& mesh_;
};

/// A cushion: a box whose edges are round, a body of revolution stretched to four corners.
void AddCushion(Furniture& chair, const Vec3& center, const Vec3& half, Mesh& mesh) {
  // Superellipsoid |x|^4 + |y|^4 + |z|^4 = 1 on a grid of longitude and latitude (Barr 1981).
  constexpr int kLongitudes = 28, kLatitudes = 14;
  const auto power = [](double v) { return std::copysign(std::sqrt(std::fabs(v)), v); };
  const auto at = [&](int i, int k) {
    const double a = 2 * std::numbers::pi * (i % kLongitudes) / kLongitudes;
    const double b = std::numbers::pi * (static_cast<double>(k) / kLatitudes - 0.5);
    const double ring = k == 0 || k == kLatitudes ? 0 : power(std::cos(b));
    return chair.At(center + Vec3{half.x * static_cast<float>(ring * power(std::cos(a))),
                                  half.y * static_cast<float>(power(std::sin(b))),
                                  half.z * static_cast<float>(ring * power(std::sin(a)))});
  };
  for (int i = 0; i < kLongitudes; ++i) {
    for (int k = 0; k < kLatitudes; ++k)
      AddQuad(at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k), kCloth, mesh);
  }
}

/// A chair that faces +z: two bent tubes from front foot over the arm to the back foot, a third as
/// the back's frame, cushions and arm rests.
void AddChair(const Vec3& place, float turn, Mesh& mesh) {
  Furniture chair(place, turn, mesh);
  for (const float side : {-0.27f, 0.27f}) {
    chair.Tube(
        {{side, 0.012f, 0.24f}, {side, 0.64f, 0.22f}, {side, 0.64f, -0.2f}, {side, 0.012f, -0.26f}},
        0.012f, 0.08f, kChrome);
    chair.Box({side, 0.665f, 0.02f}, {0.05f, 0.025f, 0.32f}, kWood);
    chair.Tube({{side, 0.4f, 0.22f}, {side, 0.4f, -0.2f}}, 0.01f, 0.05f, kChrome);
  }
  chair.Tube({{-0.22f, 0.4f, -0.2f},
              {-0.22f, 0.92f, -0.27f},
              {0.22f, 0.92f, -0.27f},
              {0.22f, 0.4f, -0.2f}},
             0.012f, 0.08f, kChrome);
  AddCushion(chair, {0, 0.44f, 0.01f}, {0.245f, 0.05f, 0.235f}, mesh);
  AddCushion(chair, {0, 0.74f, -0.235f}, {0.2f, 0.15f, 0.035f}, mesh);
}

void AddTable(Mesh& mesh) {
  Furniture table({0, 0, 0}, 0, mesh);
  table.Box({0, 0.73f, 0}, {5, 0.04f, 1.5f}, kDarkWood);
  table.Box({0, 0.68f, 0}, {4.6f, 0.06f, 1.1f}, kBlack);
  for (const float x : {-1.9f, 0.0f, 1.9f}) {
    static constexpr std::array<ProfilePoint, 9> kLeg = {{{0, 0.001f},
                                                          {0.4f, 0.001f},
                                                          {0.4f, 0.03f},
                                                          {0.12f, 0.06f},
                                                          {0.07f, 0.12f},
                                                          {0.07f, 0.5f},
                                                          {0.12f, 0.6f},
                                                          {0.3f, 0.65f},
                                                          {0, 0.65f}}};
    AddLathe({x, 0, 0}, kLeg, 48, kChrome, mesh);
  }
}

/// What lies on the table: papers, and glasses that stand on it.
void AddTableware(Sequence& random, Mesh& mesh) {
  static constexpr std::array<ProfilePoint, 9> kTumbler = {{{0, 0},
                                                            {0.03f, 0},
                                                            {0.034f, 0.05f},
                                                            {0.038f, 0.1f},
                                                            {0.036f, 0.1f},
                                                            {0.032f, 0.05f},
                                                            {0.028f, 0.012f},
                                                            {0.015f, 0.01f},
                                                            {0, 0.01f}}};
  for (int i = 0; i < 12; ++i) {
    const int place = i / 2;  // two sides
    const float x = -2.1f + 0.84f * static_cast<float>(place), z = i % 2 == 0 ? -0.5f : 0.5f;
    AddBox({x, 0.7525f, z}, {0.21f, 0.004f, 0.297f}, 0.6f * (random.Next() - 0.5f), kCeiling, mesh);
    AddLathe({x + 0.24f, 0.751f, z * 0.8f}, kTumbler, 40, kGlass, mesh);
  }
}

void AddShelf(float x, Sequence& random, Mesh& mesh) {
  constexpr float kWidth = 1.6f, kDepth = 0.3f, kTop = 2.1f;
  Furniture shelf({x, 0, -kHalfDepth + kDepth / 2 + 0.01f}, 0, mesh);
  for (const float side : {-kWidth / 2, kWidth / 2})
    shelf.Box({side, kTop / 2, 0}, {0.03f, kTop, kDepth}, kWood);
  shelf.Box({0, kTop / 2, -kDepth / 2 + 0.01f}, {kWidth, kTop, 0.02f}, kWood);
  for (int level = 0; level < 6; ++level) {
    const float y = 0.05f + 0.4f * static_cast<float>(level);
    shelf.Box({0, y, 0}, {kWidth - 0.03f, 0.03f, kDepth}, kWood);
    if (level == 5) break;
    for (float at = -kWidth / 2 + 0.03f; at < kWidth / 2 - 0.1f;) {
      const float width = 0.015f + 0.04f * random.Next(), height = 0.2f + 0.13f * random.Next(),
                  depth = 0.15f + 0.07f * random.Next();
      const auto color = static_cast<std::uint32_t>(random.Next() * kBookColors.size());
      if (random.Next() < 0.92f) {  // else a gap
        shelf.Box({at + width / 2, y + 0.017f + height / 2, -0.02f}, {width, height, depth},
                  kFirstBook + color);
      }
      at += width + 0.002f;
    }
  }
}

/// The walls, what hangs on them, and 18 lamps in the ceiling.
void AddShell(Mesh& mesh) {
  constexpr float w = kHalfWidth, d = kHalfDepth, h = kHeight;
  AddQuad({-w, 0, d}, {w, 0, d}, {w, 0, -d}, {-w, 0, -d}, kFloor, mesh);
  AddQuad({-w, h, -d}, {w, h, -d}, {w, h, d}, {-w, h, d}, kCeiling, mesh);
  AddQuad({-w, 0, -d}, {w, 0, -d}, {w, h, -d}, {-w, h, -d}, kWall, mesh);
  AddQuad({w, 0, d}, {-w, 0, d}, {-w, h, d}, {w, h, d}, kWall, mesh);
  AddQuad({-w, 0, d}, {-w, 0, -d}, {-w, h, -d}, {-w, h, d}, kWall, mesh);
  AddQuad({w, 0, -d}, {w, 0, d}, {w, h, d}, {w, h, -d}, kWall, mesh);
  AddBox({w - 0.03f, 1.5f, 0}, {0.04f, 1.2f, 3}, 0, kBoard, mesh);
  AddBox({w - 0.06f, 0.88f, 0}, {0.1f, 0.03f, 3}, 0, kWood, mesh);
  for (const float z : {-d + 0.01f, d - 0.01f})
    AddBox({0, 0.05f, z}, {2 * w, 0.1f, 0.02f}, 0, kDarkWood, mesh);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 3; ++k) {
      const Vec3 place = {-4.5f + 1.8f * static_cast<float>(i), h,
                          -2.2f + 2.2f * static_cast<float>(k)};
      AddRectangle(place - Vec3{0, 0.02f, 0}, {0, -1, 0}, 1.2f, 0.3f, kLamp, mesh);
      for (int louver = 0; louver < 7; ++louver) {
        AddBox(place + Vec3{-0.6f + 0.2f * static_cast<float>(louver), -0.05f, 0},
               {0.008f, 0.06f, 0.32f}, 0, kCeiling, mesh);
      }
      for (const float side : {-0.16f, 0.16f})
        AddBox(place + Vec3{0, -0.05f, side}, {1.22f, 0.06f, 0.01f}, 0, kCeiling, mesh);
    }
  }
}

void AddChairs(Sequence& random, Mesh& mesh) {
  constexpr float kTurn = std::numbers::pi_v<float>;
  const auto some = [&random] { return 0.3f * (random.Next() - 0.5f); };
  for (int i = 0; i < 6; ++i) {
    const float x = -2.1f + 0.84f * static_cast<float>(i);
    AddChair({x, 0, -0.95f - 0.3f * random.Next()}, some(), mesh);
    AddChair({x, 0, 0.95f + 0.3f * random.Next()}, kTurn + some(), mesh);
  }
  AddChair({-3.1f, 0, 0}, kTurn / 2 + some(), mesh);
  AddChair({3.1f, 0, 0}, -kTurn / 2 + some(), mesh);
  for (int i = 0; i < 12; ++i)  // along the front wall
    AddChair({-4.4f + 0.75f * static_cast<float>(i), 0, kHalfDepth - 0.4f}, kTurn + some() / 4,
             mesh);
}

}  // namespace

Scene MakeRoom() {
  Scene scene;
  scene.name = "room";
  scene.materials = {
      {.name = "wall", .reflectance = {0.68f, 0.66f, 0.62f}},
      {.name = "floor", .reflectance = {0.22f, 0.16f, 0.13f}},
      {.name = "ceiling", .reflectance = {0.82f, 0.82f, 0.8f}},
      {.name = "wood",
       .surface = Surface::kGlossy,
       .reflectance = {0.52f, 0.33f, 0.16f},
       .specular = {0.04f, 0.04f, 0.04f},
       .exponent = 60},
      {.name = "dark wood",
       .surface = Surface::kGlossy,
       .reflectance = {0.24f, 0.12f, 0.07f},
       .specular = {0.06f, 0.06f, 0.06f},
       .exponent = 120},
      {.name = "cloth", .reflectance = {0.6f, 0.12f, 0.1f}},
      {.name = "chrome", .surface = Surface::kMirror, .reflectance = {0.72f, 0.73f, 0.74f}},
      {.name = "board",
       .surface = Surface::kGlossy,
       .reflectance = {0.7f, 0.71f, 0.72f},
       .specular = {0.1f, 0.1f, 0.1f},
       .exponent = 200},
      {.name = "black", .reflectance = {0.05f, 0.05f, 0.05f}},
      {.name = "glass", .surface = Surface::kDielectric, .reflectance = {}, .ior = 1.5f},
      {.name = "lamp", .reflectance = {}, .emission = {9, 8.6f, 7.8f}},
  };
  for (const Rgb& color : kBookColors)
    scene.materials.push_back({.name = "book", .reflectance = color});
  Mesh& mesh = scene.mesh;
  Sequence random;
  AddShell(mesh);
  AddTable(mesh);
  AddTableware(random, mesh);
  AddChairs(random, mesh);
  for (const float x : {-4.4f, -2.7f, -1.0f, 0.7f, 2.4f}) AddShelf(x, random, mesh);
  RemoveDegenerateTriangles(mesh);  // at the poles of cushions and glasses
  WeldVertices(mesh);
  AddSmoothNormals(/*crease_degrees=*/40, mesh);
  scene.camera = {
      .position = {-4.9f, 1.75f, 2.4f}, .target = {0.6f, 0.7f, -0.7f}, .vertical_fov_degrees = 56};
  return scene;
}

}  // namespace treelight::client
