// The scenes that are made by code: valid, lit, inside their bounds, and the same each time.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "client/scenes/default_view.h"
#include "client/scenes/registry.h"
#include "client/scenes/smooth_normals.h"
#include "client/scenes/vector.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

class BuiltInSceneTest : public ::testing::TestWithParam<std::string> {
 protected:
  const Scene scene_ = *MakeScene(GetParam());
};

TEST_P(BuiltInSceneTest, IsValidAndLit) {
  const Mesh& mesh = scene_.mesh;
  EXPECT_EQ(scene_.name, GetParam());
  ASSERT_EQ(mesh.corners.size(), mesh.materials.size());
  for (const auto& triangle : mesh.corners) {
    for (const std::uint32_t corner : triangle) ASSERT_LT(corner, mesh.vertices.size());
  }
  for (const std::uint32_t material : mesh.materials) ASSERT_LT(material, scene_.materials.size());
  for (const Vec3& v : mesh.vertices) ASSERT_LT(Length(v), 40);
  EXPECT_TRUE(HasLight(scene_));
  for (const Material& material : scene_.materials) {
    EXPECT_LT(MaxChannel(material.reflectance + material.specular), 1) << material.name;
    EXPECT_FALSE(material.name.empty());
  }
  Mesh copy = mesh;
  EXPECT_EQ(RemoveDegenerateTriangles(copy), 0u);
}

TEST_P(BuiltInSceneTest, NormalsAreUnitAndOnTheFront) {
  const Mesh& mesh = scene_.mesh;
  if (mesh.normals.empty()) return;
  ASSERT_EQ(mesh.normals.size(), mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) {
    const auto& c = mesh.corners[i];
    const Vec3& a = mesh.vertices[c[0]];
    const Vec3 front = Normalize(Cross(mesh.vertices[c[1]] - a, mesh.vertices[c[2]] - a));
    for (const std::uint32_t corner : c) {
      const Vec3& normal = mesh.normals[corner];
      if (normal == Vec3{}) continue;
      ASSERT_NEAR(Length(normal), 1, 1e-5f);
      ASSERT_GT(Dot(normal, front), 0) << i;
    }
  }
}

/// Edges of the triangles of material `name` that do not have another one on the other side.
std::size_t OpenEdges(const Scene& scene, std::string_view name) {
  const auto place = [&](std::uint32_t i) {
    const Vec3& v = scene.mesh.vertices[i];
    return std::array<float, 3>{v.x + 0.0f, v.y + 0.0f, v.z + 0.0f};
  };
  std::map<std::pair<std::array<float, 3>, std::array<float, 3>>, int> sides;
  for (std::size_t i = 0; i < scene.mesh.corners.size(); ++i) {
    if (scene.materials[scene.mesh.materials[i]].name != name) continue;
    for (int k = 0; k < 3; ++k) {
      const auto from = place(scene.mesh.corners[i][k]),
                 to = place(scene.mesh.corners[i][(k + 1) % 3]);
      from < to ? ++sides[{from, to}] : --sides[{to, from}];
    }
  }
  return std::count_if(sides.begin(), sides.end(),
                       [](const auto& side) { return side.second != 0; });
}

TEST_P(BuiltInSceneTest, IsTheSameEachTime) {
  const Scene again = *MakeScene(GetParam());
  EXPECT_EQ(scene_.mesh.vertices, again.mesh.vertices);
  EXPECT_EQ(scene_.mesh.corners, again.mesh.corners);
  EXPECT_EQ(scene_.mesh.normals, again.mesh.normals);
}

INSTANTIATE_TEST_SUITE_P(All, BuiltInSceneTest, ::testing::ValuesIn(BuiltInScenes()),
                         [](const auto& param_info) { return param_info.param; });

TEST(BuiltInScenes, StandInsHaveTheSizeOfWhatTheyStandFor) {
  EXPECT_THAT(BuiltInScenes(),
              ::testing::ElementsAre("cornell", "caustic", "hall", "room", "blob"));
  EXPECT_GT(MakeScene("hall")->mesh.corners.size(), 50'000u);
  EXPECT_GT(MakeScene("room")->mesh.corners.size(), 100'000u);
  EXPECT_EQ(MakeScene("blob")->mesh.corners.size(), 200'000u + 3 * 2);
}

TEST(BuiltInScenes, BodiesAreClosed) {
  EXPECT_EQ(OpenEdges(*MakeScene("blob"), "body"), 0u);
  EXPECT_EQ(OpenEdges(*MakeScene("caustic"), "metal"), 0u);
  EXPECT_EQ(OpenEdges(*MakeScene("room"), "glass"), 0u);
  EXPECT_EQ(OpenEdges(*MakeScene("room"), "chrome"), 0u);
  EXPECT_EQ(OpenEdges(*MakeScene("room"), "cloth"), 0u);
}

/// Volume inside the triangles of material `name`; positive where their fronts are outside.
double Volume(const Scene& scene, std::string_view name) {
  double volume = 0;
  for (std::size_t i = 0; i < scene.mesh.corners.size(); ++i) {
    if (scene.materials[scene.mesh.materials[i]].name != name) continue;
    const auto& c = scene.mesh.corners[i];
    volume += Dot(scene.mesh.vertices[c[0]],
                  Cross(scene.mesh.vertices[c[1]], scene.mesh.vertices[c[2]])) /
              6;
  }
  return volume;
}

TEST(BuiltInScenes, FrontsAreOutside) {
  EXPECT_GT(Volume(*MakeScene("blob"), "body"), 1);
  // A ring of radii 0.6 and 0.63 and height 0.25.
  EXPECT_NEAR(Volume(*MakeScene("caustic"), "metal"), std::acos(-1) * (0.63 * 0.63 - 0.36) * 0.25,
              1e-4);
  EXPECT_GT(Volume(*MakeScene("room"), "glass"), 0);
  EXPECT_GT(Volume(*MakeScene("room"), "cloth"), 0);
}

TEST(BuiltInScenes, NormalsOfTheRingAreThoseOfTheCylinder) {
  const Scene scene = *MakeScene("caustic");
  int checked = 0;
  for (std::size_t i = 0; i < scene.mesh.vertices.size(); ++i) {
    const Vec3& v = scene.mesh.vertices[i];
    const Vec3& n = scene.mesh.normals[i];
    const float radius = std::sqrt(v.x * v.x + v.z * v.z);
    if (std::fabs(radius - 0.6f) > 1e-4f || n == Vec3{} || std::fabs(n.y) > 0.5f) continue;
    EXPECT_NEAR(n.x, -v.x / radius, 1e-3f);
    EXPECT_NEAR(n.z, -v.z / radius, 1e-3f);
    ++checked;
  }
  EXPECT_GE(checked, 2 * 1024);
}

TEST(BuiltInScenes, LampsShineIntoTheRoom) {
  for (const std::string& name : BuiltInScenes()) {
    const Scene scene = *MakeScene(name);
    for (std::size_t i = 0; i < scene.mesh.corners.size(); ++i) {
      const Material& material = scene.materials[scene.mesh.materials[i]];
      if (MaxChannel(material.emission) == 0) continue;
      const auto& c = scene.mesh.corners[i];
      const Vec3& a = scene.mesh.vertices[c[0]];
      const Vec3 front =
          Normalize(Cross(scene.mesh.vertices[c[1]] - a, scene.mesh.vertices[c[2]] - a));
      // A point well inside of each scene, at the height of the light or lower.
      const Vec3 inside = {0, std::min(1.0f, a.y / 2), name == "hall" ? a.z : 0.0f};
      EXPECT_GT(Dot(front, inside - a), 0) << name << ", triangle " << i << " of " << material.name;
    }
  }
}

}  // namespace
}  // namespace treelight::client
