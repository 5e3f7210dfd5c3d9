// Meshes that are cut, changed or noise: a valid mesh, or one line that names the file.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "client/scenes/mesh_file.h"
#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/change_json.h"
#include "tests/mesh_files.h"

namespace treelight::client {
namespace {

using ::testing::HasSubstr;
using ::treelight::testing::BinaryPly;
using ::treelight::testing::Glb;
using ::treelight::testing::Gltf;
using ::treelight::testing::kTriangle;
using ::treelight::testing::Pack;

class MeshFileFaultsTest : public ::treelight::testing::MeshFiles {};

/// Whatever the bytes, the answer is a valid mesh or one line that names the file.
void ExpectMeshOrOneLine(const std::string& bytes, const std::string& path) {
  const auto file = ParseMesh(bytes, path);
  if (!file.ok()) {
    const std::string message(file.status().message());
    EXPECT_THAT(message, HasSubstr(path.substr(path.find_last_of('/') + 1)));
    EXPECT_TRUE(std::all_of(message.begin(), message.end(), [](char c) {
      return c >= ' ' && c <= '~';
    })) << message;
    EXPECT_LT(message.size(), 500u);
    return;
  }
  const Mesh& mesh = file->mesh;
  ASSERT_FALSE(mesh.corners.empty());
  ASSERT_EQ(mesh.corners.size(), mesh.materials.size());
  for (const auto& triangle : mesh.corners) {
    for (const std::uint32_t corner : triangle) ASSERT_LT(corner, mesh.vertices.size());
  }
  for (const Vec3& v : mesh.vertices)
    ASSERT_TRUE(std::fabs(v.x) <= 1e18f && std::fabs(v.y) <= 1e18f && std::fabs(v.z) <= 1e18f);
}

const std::pair<const char*, std::string> kSamples[] = {
    {"/none/a.obj",
     "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nusemtl red\n"
     "f 1//1 2//1 3//1 4//1\nf -4/-1/-1 -3/1/1 -2/1/1\nv 0.5 2 0\nf 1 2 3 5 4\n"},
    {"/none/a.ply", BinaryPly()},
    {"/none/b.ply",
     "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
     "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 "
     "0\n3 "
     "0 1 2\n"},
    {"/none/a.gltf", Gltf()},
    {"/none/a.glb", Glb()}};

TEST_F(MeshFileFaultsTest, TruncatedFilesEndInOneLine) {
  for (const auto& [path, bytes] : kSamples) {
    const auto whole = ParseMesh(bytes, path);
    ASSERT_TRUE(whole.ok()) << path << whole.status();
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      SCOPED_TRACE(fmt::format("{} cut to {} bytes", path, size));
      ExpectMeshOrOneLine(bytes.substr(0, size), path);
    }
  }
  const std::string packed = Pack(kTriangle);
  for (std::size_t size = 0; size < packed.size(); ++size) {
    const auto file = Read("cut.obj.xz", packed.substr(0, size));
    EXPECT_EQ(file.status().code(), absl::StatusCode::kInvalidArgument) << size;
  }
}

/// Changes a few bytes: other values, digits and signs, bytes taken out, pieces repeated.
std::string Mutate(std::string bytes, std::mt19937& random) {
  const auto below = [&random](std::size_t n) { return random() % std::max<std::size_t>(n, 1); };
  for (std::size_t i = 0, count = 1 + below(4); i < count; ++i) {
    const std::size_t at = below(bytes.size());
    switch (below(4)) {
      case 0:
        bytes[at] = static_cast<char>(below(256));
        break;
      case 1:
        bytes[at] = "0123456789-.e/ \n[]{},:\""[below(24)];
        break;
      case 2:
        bytes.erase(at, 1 + below(8));
        break;
      default:
        bytes.insert(at, bytes.substr(below(bytes.size()), 1 + below(16)));
    }
    if (bytes.empty()) break;
  }
  return bytes;
}

TEST_F(MeshFileFaultsTest, ChangedAndRandomFilesEndInOneLine) {
  const std::uint32_t fresh = std::random_device()();
  for (const std::uint32_t seed : {7u, fresh}) {
    std::mt19937 random(seed);
    for (const auto& [path, bytes] : kSamples) {
      for (int i = 0; i < 400; ++i) {
        SCOPED_TRACE(fmt::format("{}, seed {}, round {}", path, seed, i));
        ExpectMeshOrOneLine(Mutate(bytes, random), path);
        if (HasFatalFailure()) return;
      }
      for (int i = 0; i < 50; ++i) {
        std::string noise(1 + random() % 400, '\0');
        for (char& c : noise) c = static_cast<char>(random());
        SCOPED_TRACE(fmt::format("{}, seed {}, noise {}", path, seed, i));
        ExpectMeshOrOneLine(noise, path);
      }
    }
  }
}

TEST_F(MeshFileFaultsTest, GltfOfOtherValuesEndsInOneLine) {
  const auto gltf = nlohmann::json::parse(Gltf());
  const std::uint32_t fresh = std::random_device()();
  for (const std::uint32_t seed : {5u, fresh}) {
    std::mt19937 random(seed);
    for (int i = 0; i < 600; ++i) {
      auto changed = gltf;
      for (std::size_t k = 0, count = 1 + random() % 3; k < count; ++k)
        testing::ChangeJson(changed, random);
      SCOPED_TRACE(fmt::format("seed {}, round {}: {}", seed, i, changed.dump()));
      ExpectMeshOrOneLine(changed.dump(), "/none/a.gltf");
      if (HasFatalFailure()) return;
    }
  }
}

}  // namespace
}  // namespace treelight::client
