// What --scene, --camera, --light and --material do to a scene.
#include "client/commands/scene_option.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "client/scenes/default_view.h"
#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

SceneChoice ParseFlags(const std::string& flags) {
  CLI::App app;
  SceneChoice choice;
  AddSceneOptions(app, choice);
  app.parse(flags);
  return choice;
}

absl::StatusOr<LoadedScene> Load(const std::string& flags) {
  return LoadChosenScene(ParseFlags(flags));
}

std::string ParseError(const std::string& flags) {
  try {
    ParseFlags(flags);
  } catch (const CLI::ParseError& error) {
    return error.what();
  }
  return "";
}

TEST(SceneOptionTest, TheCameraIsChanged) {
  const auto plain = Load("");
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_EQ(plain->scene.name, "cornell");
  const auto loaded = Load("--scene caustic --camera-position 1,2,-3.5 --camera-fov 25");
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const Camera &camera = loaded->scene.camera, &own = loaded->cameras[0].camera;
  EXPECT_EQ(camera.position, (Vec3{1, 2, -3.5f}));
  EXPECT_EQ(camera.target, own.target);
  EXPECT_EQ(camera.vertical_fov_degrees, 25);
  EXPECT_THAT(std::string(Load("--camera x").status().message()), HasSubstr("it has: default"));
  EXPECT_THAT(std::string(Load("--camera-position 0,0,0 --camera-target 0,5,0").status().message()),
              HasSubstr("parallel to the view"));
}

TEST(SceneOptionTest, FlagsWinOverTheSceneFile) {
  const std::string path =
      ::testing::TempDir() + fmt::format("scene_option_test.{}.json", getpid());
  std::ofstream(path) << R"({"built_in": "cornell",
    "materials": {"red": {"surface": "glossy", "reflectance": 0.3, "specular": 0.2, "exponent": 7}},
    "cameras": [
      {"name": "a", "position": [0, 1, 5], "target": [0, 1, 0], "vertical_fov_degrees": 30},
      {"name": "b", "position": [0, 2, 5], "target": [0, 2, 0], "vertical_fov_degrees": 50}]})";
  const auto plain = Load("--scene " + path);
  const auto changed = Load("--scene " + path +
                            " --camera b --camera-target 1,2,3 --camera-fov 12 "
                            "--material red:reflectance=0.5 --material red:exponent=9");
  std::filesystem::remove(path);
  ASSERT_TRUE(plain.ok() && changed.ok()) << plain.status() << changed.status();
  EXPECT_EQ(plain->scene.camera.vertical_fov_degrees, 30);
  EXPECT_EQ(plain->scene.materials[1].reflectance, (Rgb{0.3f, 0.3f, 0.3f}));
  const Camera& camera = changed->scene.camera;
  EXPECT_EQ(camera.position, (Vec3{0, 2, 5}));  // of b
  EXPECT_EQ(camera.target, (Vec3{1, 2, 3}));
  EXPECT_EQ(camera.vertical_fov_degrees, 12);
  const Material& red = changed->scene.materials[1];
  EXPECT_EQ(red.surface, Surface::kGlossy);  // of the file
  EXPECT_EQ(red.reflectance, (Rgb{0.5f, 0.5f, 0.5f}));
  EXPECT_EQ(red.specular, (Rgb{0.2f, 0.2f, 0.2f}));
  EXPECT_EQ(red.exponent, 9);
}

TEST(SceneOptionTest, LightsAreAddedAndMaterialsChanged) {
  const auto loaded = Load(
      "--light 0,1,0,5,6,7 --light 1,1,1,1,1,1 --material red:surface=mirror "
      "--material red:reflectance=0.9");
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  ASSERT_THAT(loaded->scene.point_lights, SizeIs(2));
  EXPECT_EQ(loaded->scene.point_lights[0].position, (Vec3{0, 1, 0}));
  EXPECT_EQ(loaded->scene.point_lights[0].intensity, (Rgb{5, 6, 7}));
  EXPECT_EQ(loaded->scene.materials[1].surface, Surface::kMirror);
  EXPECT_EQ(loaded->scene.materials[1].reflectance, (Rgb{0.9f, 0.9f, 0.9f}));
}

TEST(SceneOptionTest, WhatIsNoVectorIsRefused) {
  EXPECT_THAT(ParseError("--camera-position 1,2"), HasSubstr("'1,2' is not X,Y,Z"));
  EXPECT_THAT(ParseError("--camera-target 1,2,nan"), HasSubstr("is not X,Y,Z"));
  EXPECT_THAT(ParseError("--camera-up 1,,2"), HasSubstr("is not X,Y,Z"));
  EXPECT_THAT(ParseError("--light 1,2,3"), HasSubstr("X,Y,Z,R,G,B"));
  EXPECT_THAT(ParseError("--light 1,2,3,-1,0,0"), HasSubstr("negative intensity"));
  EXPECT_THAT(ParseError("--camera-fov 180"), HasSubstr("--camera-fov"));
}

TEST(SceneOptionTest, ABareMeshKeepsItsLampUnlessALightIsGiven) {
  const std::string path = ::testing::TempDir() + fmt::format("scene_option_test.{}.obj", getpid());
  std::ofstream(path) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const auto lit = Load("--scene " + path);
  const auto given = Load("--scene " + path + " --light 0,0,5,9,9,9");
  std::filesystem::remove(path);
  ASSERT_TRUE(lit.ok() && given.ok()) << lit.status() << given.status();
  EXPECT_THAT(lit->scene.mesh.corners, SizeIs(1 + 2));
  EXPECT_TRUE(HasLight(lit->scene));
  EXPECT_THAT(given->scene.mesh.corners, SizeIs(1));
  EXPECT_THAT(given->scene.mesh.materials, SizeIs(1));
  EXPECT_THAT(given->scene.point_lights, SizeIs(1));
  EXPECT_THAT(lit->notes, SizeIs(2));
  EXPECT_THAT(given->notes, SizeIs(1));
}

}  // namespace
}  // namespace treelight::client
