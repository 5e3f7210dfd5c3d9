// Scene files: what they mean, what is wrong with them, and the files that come with the program.
#include "client/scenes/scene_file.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "client/scenes/default_view.h"
#include "client/scenes/material_json.h"
#include "client/scenes/vector.h"
#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/change_json.h"
#include "tests/shared_scenes.h"

namespace treelight::client {
namespace {

using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

/// A folder with a mesh of two triangles, of materials a and b, in it.
class SceneFileTest : public ::testing::Test {
 protected:
  SceneFileTest() : folder_(::testing::TempDir() + fmt::format("scene_file_test.{}", getpid())) {
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ + "/mesh.obj")
        << "v 1 2 3\nv 2 2 3\nv 1 3 3\nusemtl a\nf 1 2 3\nusemtl b\nv 1 2 4\nf 1 2 4\n";
  }
  ~SceneFileTest() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<LoadedScene> Parse(const std::string& text) const {
    return ParseSceneFile(text, folder_ + "/test.json");
  }
  /// The message about a scene file that must be refused, behind the file's name.
  std::string Error(const std::string& text) const {
    const auto scene = Parse(text);
    const std::string message(scene.status().message());
    EXPECT_FALSE(scene.ok()) << text;
    EXPECT_THAT(message, StartsWith(folder_ + "/test.json:"));
    return message.substr(std::min(folder_.size() + 10, message.size()));
  }
  /// The same for a file that is right but for `member`.
  std::string ErrorWith(const std::string& member) const {
    return Error(fmt::format(R"({{"meshes": [{{"file": "mesh.obj"}}],
      "cameras": [{{"name": "c", "position": [0, 0, 5], "target": [0, 0, 0]}}], {}}})",
                             member));
  }

  const std::string folder_;
};

/// A scene file with these members and a camera.
std::string Document(const std::string& members) {
  return fmt::format(
      R"({{{}, "cameras": [{{"name": "c", "position": [0, 0, 5], "target": [0, 0, 0]}}]}})",
      members);
}

TEST_F(SceneFileTest, EverythingThatCanBeSaid) {
  const auto loaded = Parse(R"({
    "description": "all keys", "exposure": 2.5,
    "new_materials": {"ground": {"reflectance": 0.5},
                      "ball": {"surface": "dielectric", "ior": 1.5, "transmittance": [0.9, 1, 0.9]}},
    "meshes": [{"file": "mesh.obj", "up": "z", "scale": 2, "turn_degrees": 90,
                "translate": [10, 0, 0], "drop_materials": ["b"], "normals": "flat"}],
    "materials": {"a": {"surface": "glossy", "reflectance": [0.1, 0.2, 0.3], "specular": 0.4,
                        "exponent": 30, "emission": [1, 2, 3]}},
    "quads": [{"center": [0, -1, 0], "size": [4, 2], "material": "ground"}],
    "spheres": [{"center": [0, 1, 0], "radius": 0.5, "material": "ball"}],
    "lights": [{"type": "point", "position": [1, 2, 3], "intensity": 7},
               {"type": "spot", "position": [0, 5, 0], "intensity": [1, 2, 3],
                "direction": [0, -2, 0], "cone_degrees": 30, "falloff_begin_degrees": 20},
               {"type": "area", "center": [0, 4, 0], "size": [1, 3], "radiance": [9, 8, 7]}],
    "cameras": [{"name": "near", "position": [0, 0, 5], "target": [0, 0, 0]},
                {"name": "far", "position": [0, 0, 50], "target": [0, 0, 0], "up": [3, 0, 0],
                 "vertical_fov_degrees": 20}]})");
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const Scene& scene = loaded->scene;
  EXPECT_EQ(loaded->exposure, 2.5f);
  EXPECT_EQ(scene.name, "test");
  // (1, 2, 3) with z up is (1, 3, -2); turned by 90 degrees (-2, 3, -1); then 2 x + (10, 0, 0).
  EXPECT_LT(Length(scene.mesh.vertices[0] - Vec3{6, 6, -2}), 1e-5f);
  EXPECT_THAT(scene.mesh.corners, SizeIs(1 + 2 + 2));
  EXPECT_THAT(scene.mesh.normals, SizeIs(0));
  const Material& a = scene.materials[scene.mesh.materials[0]];
  EXPECT_EQ(a.surface, Surface::kGlossy);
  EXPECT_EQ(a.specular, (Rgb{0.4f, 0.4f, 0.4f}));
  EXPECT_EQ(a.emission, (Rgb{1, 2, 3}));
  EXPECT_EQ(scene.materials[scene.mesh.materials[1]].name, "ground");
  ASSERT_THAT(scene.spheres, SizeIs(1));
  EXPECT_EQ(scene.materials[scene.spheres[0].material].transmittance, (Rgb{0.9f, 1, 0.9f}));
  ASSERT_THAT(scene.point_lights, SizeIs(2));
  EXPECT_EQ(scene.point_lights[0].cone_degrees, 180);
  EXPECT_EQ(scene.point_lights[0].intensity, (Rgb{7, 7, 7}));
  EXPECT_EQ(scene.point_lights[1].direction, (Vec3{0, -1, 0}));
  EXPECT_EQ(scene.point_lights[1].falloff_begin_degrees, 20);
  // The area light is last, and shines down.
  EXPECT_EQ(scene.materials[scene.mesh.materials.back()].emission, (Rgb{9, 8, 7}));
  const auto& corner = scene.mesh.corners.back();
  const Vec3 p = scene.mesh.vertices[corner[0]];
  const Vec3 normal = Cross(scene.mesh.vertices[corner[1]] - p, scene.mesh.vertices[corner[2]] - p);
  EXPECT_NEAR(normal.y, -3, 1e-5f);  // twice the area of a triangle of 1 x 3
  ASSERT_THAT(loaded->cameras, SizeIs(2));
  EXPECT_EQ(scene.camera.position.z, 5);
  EXPECT_EQ(FindCamera(*loaded, "far")->vertical_fov_degrees, 20);
  EXPECT_EQ(FindCamera(*loaded, "far")->up, (Vec3{1, 0, 0}));
  EXPECT_THAT(std::string(FindCamera(*loaded, "x").status().message()), HasSubstr("near, far"));
}

TEST_F(SceneFileTest, ABuiltInSceneCanBeChanged) {
  const auto loaded = Parse(R"({"built_in": "cornell", "materials": {"red": {"reflectance": 0.1}},
    "cameras": [{"name": "c", "position": [0, 1, 2], "target": [0, 1, 0]}]})");
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_THAT(loaded->cameras, SizeIs(1));
  EXPECT_EQ(loaded->scene.materials[1].reflectance, (Rgb{0.1f, 0.1f, 0.1f}));
}

TEST_F(SceneFileTest, FlippedMaterialsShowTheirBacks) {
  const auto plain = Parse(Document(R"("meshes": [{"file": "mesh.obj"}])"));
  const auto turned =
      Parse(Document(R"("meshes": [{"file": "mesh.obj", "flip_materials": ["a"]}])"));
  ASSERT_TRUE(plain.ok() && turned.ok()) << turned.status();
  EXPECT_EQ(plain->scene.mesh.corners[0][1], turned->scene.mesh.corners[0][2]);
  EXPECT_EQ(plain->scene.mesh.corners[1], turned->scene.mesh.corners[1]);
}

TEST_F(SceneFileTest, ErrorsNameFilePlaceAndValue) {
  EXPECT_THAT(Error("{\n  \"meshes\": [,]\n}"), StartsWith(":2:14: "));
  EXPECT_THAT(ErrorWith(R"("exposure": 1e999)"), HasSubstr("number overflow"));
  EXPECT_THAT(Error("[]"), HasSubstr("an object, not []"));
  EXPECT_THAT(Error(R"({"meshes": [{"file": "mesh.obj"}]})"),
              HasSubstr("cameras: there must be one"));
  EXPECT_THAT(ErrorWith(R"("ligths": [])"),
              HasSubstr(R"(unknown key "ligths"; known: built_in, )"));
  EXPECT_THAT(ErrorWith(R"("built_in": 5)"), HasSubstr("built_in: a string, not 5"));
  EXPECT_THAT(Error(Document(R"("meshes": [{"file": 5}])")),
              HasSubstr("meshes[0].file: a string, not 5"));
  EXPECT_THAT(Error(Document(R"("meshes": [{"file": "none.obj", "sacle": 2}])")),
              HasSubstr("meshes[0]: unknown key \"sacle\""));
  EXPECT_THAT(ErrorWith(R"("exposure": 1, "exposure": 2)"), HasSubstr("\"exposure\" stands twice"));
  EXPECT_THAT(ErrorWith(R"("exposure": "high")"), HasSubstr(": exposure: a number, not \"high\""));
  EXPECT_THAT(ErrorWith(R"("lights": [{"type": "point", "position": [0, 0, 0], "intensity": 1},
                                      {"type": "point", "position": [0, 0, 0], "intensity": [1, 2]}])"),
              HasSubstr(": lights[1].intensity: 3 numbers, not 2"));
  EXPECT_THAT(
      ErrorWith(R"("lights": [{"type": "point", "position": [0, true, 0], "intensity": 1}])"),
      HasSubstr(": lights[0].position[1]: a number, not true"));
  EXPECT_THAT(ErrorWith(R"("lights": [{"type": "point", "intensity": 1}])"),
              HasSubstr(": lights[0]: \"position\" is missing"));
  EXPECT_THAT(ErrorWith(R"("lights": [{"type": "point", "position": [0, 0, 0], "intensity": -1}])"),
              HasSubstr(": lights[0].intensity: -1 is not within [0, 1e+18]"));
  EXPECT_THAT(ErrorWith(R"("lights": [{"type": "laser"}])"),
              HasSubstr(": lights[0].type: one of point, spot, area, not \"laser\""));
  EXPECT_THAT(
      ErrorWith(
          R"("lights": [{"type": "area", "center": [0, 0, 0], "size": [1, 0], "radiance": 1}])"),
      HasSubstr(": lights[0].size[1]: 0 is not within"));
  EXPECT_THAT(ErrorWith(R"("lights": [{"type": "spot", "position": [0, 0, 0], "intensity": 1,
                                       "cone_degrees": 20, "falloff_begin_degrees": 30}])"),
              HasSubstr(": lights[0].falloff_begin_degrees: 30 is not within [0, 20]"));
  EXPECT_THAT(ErrorWith(R"("materials": {"c": {"ior": 2}})"),
              HasSubstr(": materials: there is no material \"c\"; there are: a, b"));
  EXPECT_THAT(ErrorWith(R"("materials": {"a": {"reflectance": [0, 1.5, 0]}})"),
              HasSubstr(": materials.a.reflectance[1]: 1.5 is not within [0, 1]"));
  EXPECT_THAT(
      ErrorWith(
          R"("materials": {"a": {"surface": "glossy", "reflectance": 0.8, "specular": 0.4}})"),
      HasSubstr(": materials.a: reflectance and specular together are 1.2, more than 1"));
  EXPECT_THAT(ErrorWith(R"("quads": [{"center": [0, 0, 0], "size": [1, 1], "material": "gold"}])"),
              HasSubstr(": quads[0].material: there is no material \"gold\""));
  EXPECT_THAT(ErrorWith(R"("spheres": [{"center": [0, 0, 0], "radius": 0, "material": "a"}])"),
              HasSubstr(": spheres[0].radius: 0 is not within"));
}

TEST_F(SceneFileTest, ErrorsOfMeshesAndCameras) {
  unsetenv("TREELIGHT_SCENES");
  EXPECT_THAT(Error(Document(R"("meshes": [{"file": "gone.obj"}])")),
              HasSubstr(": meshes[0].file: there is no"));
  EXPECT_THAT(Error(Document(R"("meshes": [{"file": "mesh.obj", "scale": -1}])")),
              HasSubstr(": meshes[0].scale: -1 is not within"));
  EXPECT_THAT(Error(Document(R"("meshes": [{"file": "mesh.obj", "material": "x"}])")),
              HasSubstr(": meshes[0].material: \"new_materials\" has no \"x\""));
  EXPECT_THAT(Error(R"({"meshes": [{"file": "mesh.obj"}], "cameras": [
                {"name": "c", "position": [0, 5, 0], "target": [0, 0, 0]}]})"),
              HasSubstr(": cameras[0]: \"up\" is parallel"));
  EXPECT_THAT(Error(R"({"meshes": [{"file": "mesh.obj"}], "cameras": [
                {"name": "c", "position": [0, 0, 5], "target": [0, 0, 0]},
                {"name": "c", "position": [0, 0, 6], "target": [0, 0, 0]}]})"),
              HasSubstr(": cameras[1].name: a second \"c\""));
  EXPECT_THAT(Error(Document(R"("description": "")")), HasSubstr("neither meshes nor quads"));
}

TEST_F(SceneFileTest, MeshesAreFoundInTheSharedFolderToo) {
  std::filesystem::create_directories(folder_ + "/elsewhere");
  std::filesystem::rename(folder_ + "/mesh.obj", folder_ + "/elsewhere/moved.obj");
  setenv("TREELIGHT_SCENES", (folder_ + "/elsewhere").c_str(), 1);
  const auto loaded = Parse(Document(R"("meshes": [{"file": "moved.obj"}])"));
  EXPECT_TRUE(loaded.ok()) << loaded.status();
  unsetenv("TREELIGHT_SCENES");
}

TEST_F(SceneFileTest, ChangedFilesEndInOneLine) {
  const std::string text = Document(R"("new_materials": {"g": {"reflectance": 0.5}},
    "quads": [{"center": [0, -1, 0], "size": [4, 2], "material": "g"}],
    "lights": [{"type": "point", "position": [1, 2, 3], "intensity": 7}])");
  ASSERT_TRUE(Parse(text).ok());
  const std::uint32_t fresh = std::random_device()();
  for (const std::uint32_t seed : {3u, fresh}) {
    std::mt19937 random(seed);
    for (int i = 0; i < 2000; ++i) {
      std::string changed = text;
      if (i < static_cast<int>(text.size())) {
        changed.resize(i);
      } else {
        changed[random() % text.size()] = static_cast<char>(random() % 256);
      }
      const auto scene = Parse(changed);
      if (scene.ok()) continue;
      const std::string message(scene.status().message());
      EXPECT_THAT(message, StartsWith(folder_)) << "seed " << seed << ", round " << i;
      EXPECT_EQ(message.find('\n'), message.npos) << "seed " << seed << ", round " << i;
    }
  }
}

TEST_F(SceneFileTest, OtherValuesEndInOneLine) {
  const auto scene = nlohmann::json::parse(R"({"exposure": 1,
    "new_materials": {"g": {"surface": "glossy", "reflectance": 0.5, "specular": [0.1, 0.1, 0.1]}},
    "meshes": [{"file": "mesh.obj", "up": "z", "drop_materials": ["a"], "scale": 2}],
    "materials": {"b": {"emission": [1, 1, 1]}},
    "quads": [{"center": [0, -1, 0], "size": [4, 2], "material": "g", "normal": [0, 0, 1]}],
    "spheres": [{"center": [0, 1, 0], "radius": 0.5, "material": "g"}],
    "lights": [{"type": "spot", "position": [1, 2, 3], "intensity": 7, "cone_degrees": 30},
               {"type": "area", "center": [1, 2, 3], "radiance": 7, "size": [1, 1]}],
    "cameras": [{"name": "c", "position": [0, 0, 5], "target": [0, 0, 0]}]})");
  ASSERT_TRUE(Parse(scene.dump()).ok()) << Parse(scene.dump()).status();
  const std::uint32_t fresh = std::random_device()();
  for (const std::uint32_t seed : {11u, fresh}) {
    std::mt19937 random(seed);
    for (int i = 0; i < 1000; ++i) {
      auto changed = scene;
      for (std::size_t k = 0, count = 1 + random() % 3; k < count; ++k)
        testing::ChangeJson(changed, random);
      const auto loaded = Parse(changed.dump());
      if (loaded.ok()) continue;
      const std::string message(loaded.status().message());
      EXPECT_THAT(message, StartsWith(folder_)) << "seed " << seed << ": " << changed;
      EXPECT_EQ(message.find('\n'), message.npos) << "seed " << seed << ": " << changed;
    }
  }
}

TEST_F(SceneFileTest, MaterialsAreOverriddenInWords) {
  auto scene = Parse(Document(R"("meshes": [{"file": "mesh.obj"}])"))->scene;
  EXPECT_TRUE(OverrideMaterial("a:surface=mirror", scene).ok());
  EXPECT_TRUE(OverrideMaterial("a:reflectance=0.9,0.8,0.7", scene).ok());
  EXPECT_EQ(scene.materials[0].surface, Surface::kMirror);
  EXPECT_EQ(scene.materials[0].reflectance, (Rgb{0.9f, 0.8f, 0.7f}));
  EXPECT_EQ(OverrideMaterial("c:ior=2", scene).code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(OverrideMaterial("a:ior", scene).message()), HasSubstr("NAME:KEY=VALUE"));
  EXPECT_THAT(std::string(OverrideMaterial("a:iro=2", scene).message()), HasSubstr("unknown key"));
  EXPECT_THAT(std::string(OverrideMaterial("a:ior=x", scene).message()),
              HasSubstr("--material: a.ior: a number, not \"x\""));
}

TEST_F(SceneFileTest, ABareMeshIsSeenAndLit) {
  const auto loaded = LoadScene(folder_ + "/mesh.obj");
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_TRUE(HasLight(loaded->scene));
  EXPECT_TRUE(loaded->has_default_light);
  EXPECT_THAT(loaded->notes, ElementsAre(HasSubstr("camera that was made up"),
                                         HasSubstr("lamp that was made up")));
  const Camera& camera = loaded->scene.camera;
  const Vec3 view = Normalize(camera.target - camera.position);
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3 to = Normalize(loaded->scene.mesh.vertices[i] - camera.position);
    EXPECT_GT(Dot(to, view), std::cos(20 * std::acos(-1.0f) / 180));
  }
  EXPECT_THAT(std::string(LoadScene("nothing").status().message()), HasSubstr("cornell, caustic"));
  EXPECT_EQ(SceneName("a/b c.obj.xz"), "b-c");
  EXPECT_EQ(SceneName("cornell"), "cornell");
}

/// Every ready-made file loads, is lit, and its cameras stand in the box of the scene or outside
/// all.
TEST(ReadyMadeScenes, LoadAndShine) {
  const std::string shared = testing::SharedScenesFolder();
  if (shared.empty()) {
    GTEST_SKIP()
        << "NOT TESTED: the sample scenes are not here; set TREELIGHT_SCENES to their folder";
  }
  setenv("TREELIGHT_SCENES", shared.c_str(), 1);
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(TREELIGHT_SOURCE_FOLDER "/scenes")) {
    if (entry.path().extension() != ".json") continue;
    SCOPED_TRACE(entry.path().string());
    const auto loaded = LoadScene(entry.path().string());
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    EXPECT_TRUE(HasLight(loaded->scene));
    for (const NamedCamera& camera : loaded->cameras) EXPECT_FALSE(camera.name.empty());
    for (const Material& material : loaded->scene.materials)
      EXPECT_LE(MaxChannel(material.reflectance + material.specular), 1 + 1e-6f) << material.name;
    ++count;
  }
  EXPECT_GE(count, 14);
}

}  // namespace
}  // namespace treelight::client
