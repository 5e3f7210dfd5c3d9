// The sample scenes, which are not part of the repository, have what their README says.
#include "tests/shared_scenes.h"

#include <algorithm>
#include <cctype>
#include <string>

#include "client/scenes/mesh_file.h"
#include "client/scenes/vector.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using ::testing::HasSubstr;

struct SharedScene {
  const char* file;
  std::size_t triangles, degenerate;  // as its README says
  Vec3 min, max;
};

class SharedSceneTest : public ::testing::TestWithParam<SharedScene> {};

TEST_P(SharedSceneTest, HasTheTrianglesAndTheBoxOfItsReadme) {
  const std::string folder = testing::SharedScenesFolder();
  if (folder.empty()) {
    GTEST_SKIP()
        << "NOT TESTED: the sample scenes are not here; set TREELIGHT_SCENES to their folder";
  }
  const auto file = ReadMeshFile(folder + "/" + GetParam().file);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->mesh.corners.size() + file->degenerate_count, GetParam().triangles);
  if (GetParam().degenerate > 0) {
    EXPECT_EQ(file->degenerate_count, GetParam().degenerate);
  }
  Box box;
  for (const Vec3& vertex : file->mesh.vertices) box.Extend(vertex);
  const float near = 0.0006f * std::max(1.0f, box.max.x / 10);  // half of the last digit there
  EXPECT_LT(Length(box.min - GetParam().min), 2 * near);
  EXPECT_LT(Length(box.max - GetParam().max), 2 * near);
  for (const std::string& note : file->notes)
    EXPECT_THAT(note, ::testing::AnyOf(HasSubstr("without area"), HasSubstr("scaled down")));
}

INSTANTIATE_TEST_SUITE_P(
    All, SharedSceneTest,
    ::testing::Values(
        SharedScene{"sibenik/sibenik.obj.xz",
                    75284,
                    0,
                    {-20.141f, -15.312f, -8.497f},
                    {20.141f, 15.300f, 8.497f}},
        SharedScene{"dragon/dragon_vrip.ply.xz",
                    871414,
                    108,
                    {-0.1083f, 0.0527f, -0.0504f},
                    {0.0966f, 0.1972f, 0.0412f}},
        SharedScene{"conference/conference.obj.xz",
                    331179,
                    53627,
                    {-1020.1f, -2.8f, -1055.7f},
                    {1685.8f, 650.3f, 668.5f}},
        SharedScene{"conference/conference_lbl.obj.xz",
                    210200,
                    0,
                    {-0.178f, -0.165f, -0.005f},
                    {11.125f, 7.010f, 2.713f}},
        SharedScene{
            "cornell/CornellBox-Original.obj", 36, 0, {-1.02f, 0, -1.04f}, {1, 1.99f, 0.99f}},
        SharedScene{"cornell/CornellBox-Water.obj.xz",
                    7088,
                    0,
                    {-1.02f, 0, -1.04f},
                    {1.004f, 1.59f, 0.99f}},
        SharedScene{"caustics/MNCardioid.obj", 130, 0, {-17.1f, 0, -17.1f}, {17.1f, 2, 17.1f}}),
    [](const auto& param_info) {
      std::string name = param_info.param.file;
      std::replace_if(
          name.begin(), name.end(),
          [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
      return name;
    });

}  // namespace
}  // namespace treelight::client
