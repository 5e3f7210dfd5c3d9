// Reading meshes: what files mean, and that broken ones say where.
#include "client/scenes/mesh_file.h"

#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "client/scenes/file_bytes.h"
#include "client/scenes/vector.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/mesh_files.h"

namespace treelight::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::treelight::testing::BinaryPly;
using ::treelight::testing::Glb;
using ::treelight::testing::Gltf;
using ::treelight::testing::GltfWith;
using ::treelight::testing::kTriangle;
using ::treelight::testing::Pack;

class MeshFileTest : public ::treelight::testing::MeshFiles {};

double Area(const Mesh& mesh) {
  double area = 0;
  for (const auto& c : mesh.corners) {
    const Vec3& a = mesh.vertices[c[0]];
    area += Length(Cross(mesh.vertices[c[1]] - a, mesh.vertices[c[2]] - a)) / 2;
  }
  return area;
}

TEST_F(MeshFileTest, ObjHasPolygonsAndNegativeIndices) {
  const auto good = Read("a.obj",
                         "# a square and a house\n"
                         "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
                         "f -4 -3 -2 -1\n"
                         "v 0.5 2 0\n"
                         "  f 1 2 \\\n   3 -1 4\n");
  ASSERT_TRUE(good.ok()) << good.status();
  EXPECT_THAT(good->mesh.corners, SizeIs(2 + 3));
  EXPECT_THAT(good->mesh.vertices, SizeIs(5));
  EXPECT_NEAR(Area(good->mesh), 1 + 1.5, 1e-6);
  EXPECT_EQ(good->degenerate_count, 0u);
}

TEST_F(MeshFileTest, FacesMayStandBeforeTheirVertices) {
  const auto file = Read("a.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(file->mesh.corners, SizeIs(1));
}

TEST_F(MeshFileTest, BrokenObjSaysWhere) {
  EXPECT_THAT(Error("a.obj", "v 0 0 0\nv 1 x 0\n"), StartsWith("a.obj:2: 'x' is no number"));
  EXPECT_THAT(Error("a.obj", "v 0 0\n"), StartsWith("a.obj:1: 2 numbers"));
  EXPECT_THAT(Error("a.obj", "v 0 0 nan\n"), StartsWith("a.obj:1: 'nan' is not within"));
  EXPECT_THAT(Error("a.obj", "v 0 0 2e18\n"), StartsWith("a.obj:1: '2e18' is not within"));
  EXPECT_THAT(Error("a.obj", std::string(kTriangle) + "f 1 2 9\n"),
              StartsWith("a.obj:5: vertex 9: the file has 3"));
  EXPECT_THAT(Error("a.obj", std::string(kTriangle) + "f 1 2 -4\n"),
              StartsWith("a.obj:5: vertex -4: there are 3 so far"));
  EXPECT_THAT(Error("a.obj", std::string(kTriangle) + "f 1 2 0\n"),
              StartsWith("a.obj:5: vertex 0"));
  EXPECT_THAT(Error("a.obj", std::string(kTriangle) + "f 1 2\n"), HasSubstr("a face of 2 corners"));
  EXPECT_THAT(Error("a.obj", std::string(kTriangle) + "f 1//1 2//1 3//1\n"),
              StartsWith("a.obj:5: normal 1: the file has 0"));
  EXPECT_THAT(Error("a.obj", "v 0 0 0\n\x01\x02\x03\n"),
              StartsWith("a.obj:2: '\?\?\?' is no statement"));
  EXPECT_THAT(Error("a.obj", "v 0 0 0\n"), HasSubstr("no faces"));
  EXPECT_THAT(Error("a.obj", ""), HasSubstr("no faces"));
}

TEST_F(MeshFileTest, MissingMaterialsAreToldInOneLineAndAreGrey) {
  const std::string obj = "mtllib gone.mtl\n" + std::string(kTriangle);
  const auto file = Read("a.obj", obj);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(file->notes,
              ElementsAre(HasSubstr("a.obj:1: there is no material file \"gone.mtl\"")));
  EXPECT_EQ(file->materials[0].reflectance, (Rgb{0.6f, 0.6f, 0.6f}));

  Write("b.mtl", "newmtl known\nKd 1 0 0\n");
  const auto other =
      Read("b.obj", "mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl unknown\nf 1 2 3\n");
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_THAT(other->notes, ElementsAre(HasSubstr("b.obj:5: material \"unknown\" is in no")));
}

TEST_F(MeshFileTest, NamesMayHaveBlanksAndHashes) {
  Write("my file.mtl", "# a comment\nnewmtl Material #25\nKd 1 0 0 # red\n");
  const auto file = Read("a.obj",
                         "mtllib my file.mtl\nv 0 0 0 # first\nv 1 0 0\nv 0 1 0\n"
                         "usemtl Material #25\nf 1 2 3\n");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(file->notes, IsEmpty());
  EXPECT_EQ(file->materials[0].name, "Material #25");
  EXPECT_EQ(file->materials[0].reflectance, (Rgb{1, 0, 0}));
}

TEST_F(MeshFileTest, BrokenMaterialFileSaysWhere) {
  Write("a.mtl", "newmtl m\nKd 1 0\n");
  EXPECT_THAT(Error("a.obj", "mtllib a.mtl\n" + std::string(kTriangle)),
              StartsWith("a.mtl:2: Kd: 2 numbers"));
  Write("a.mtl", "newmtl m\nNi -1\n");
  EXPECT_THAT(Error("a.obj", "mtllib a.mtl\n" + std::string(kTriangle)),
              StartsWith("a.mtl:2: Ni: '-1' is not within"));
}

TEST_F(MeshFileTest, IllumChoosesTheSurface) {
  const Material diffuse = OneMaterial("Kd 0.5 0.4 0.3\nKs 0.3 0.3 0.3\nillum 1\n");
  EXPECT_EQ(diffuse.surface, Surface::kDiffuse);
  EXPECT_EQ(diffuse.reflectance, (Rgb{0.5f, 0.4f, 0.3f}));

  const Material glossy = OneMaterial("Kd 0.5 0.4 0.3\nKs 0.3 0.2 0.1\nNs 40\nillum 2\n");
  EXPECT_EQ(glossy.surface, Surface::kGlossy);
  EXPECT_EQ(glossy.reflectance, (Rgb{0.5f, 0.4f, 0.3f}));
  EXPECT_EQ(glossy.specular, (Rgb{0.3f, 0.2f, 0.1f}));
  EXPECT_EQ(glossy.exponent, 40);

  EXPECT_EQ(OneMaterial("Kd 0.5 0.4 0.3\nKs 0.009 0 0\nNs 40\nillum 2\n").surface,
            Surface::kDiffuse);

  for (const char* illum : {"3", "5"}) {
    const Material mirror = OneMaterial(fmt::format("Kd 0 0 0\nKs 0.9 0.8 0.7\nillum {}\n", illum));
    EXPECT_EQ(mirror.surface, Surface::kMirror);
    EXPECT_EQ(mirror.reflectance, (Rgb{0.9f, 0.8f, 0.7f}));
  }
  EXPECT_EQ(OneMaterial("Kd 0.3 0.3 0.3\nKs 0 0 0\nillum 3\n").reflectance,
            (Rgb{0.3f, 0.3f, 0.3f}));
}

TEST_F(MeshFileTest, TransmissiveMaterialsAreSolidsOrPanes) {
  const Material solid = OneMaterial("Kd 0 0 0\nTf 0.25 1 0.81\nNi 1.5\nillum 7\n");
  EXPECT_EQ(solid.surface, Surface::kDielectric);
  EXPECT_EQ(solid.ior, 1.5f);
  // Tf is what passes the object: each of its two surfaces lets the root of it pass.
  EXPECT_FLOAT_EQ(solid.transmittance.r, 0.5f);
  EXPECT_FLOAT_EQ(solid.transmittance.b, 0.9f);
  EXPECT_EQ(OneMaterial("Ni 1.33\nillum 6\n").surface, Surface::kDielectric);
  for (const char* fields : {"Tf 0.5 0.4 0.3\nNi 1\nillum 6\n", "Tf 0.5 0.4 0.3\nNi 1.5\nillum 4\n",
                             "Tf 0.5 0.4 0.3\nillum 7\n"}) {
    const Material pane = OneMaterial(fields);
    EXPECT_EQ(pane.surface, Surface::kPane) << fields;
    EXPECT_EQ(pane.transmittance, (Rgb{0.5f, 0.4f, 0.3f})) << fields;
  }
}

TEST_F(MeshFileTest, NoMaterialGivesEnergyAndEmissionIsRadiance) {
  const Material bright =
      OneMaterial("Kd 0.8 0.4 0.2\nKs 0.8 0.8 0.8\nNs 10\nillum 2\nKe 17 12 4\n");
  EXPECT_LE(MaxChannel(bright.reflectance + bright.specular), 1);
  EXPECT_NEAR(MaxChannel(bright.reflectance + bright.specular), 1, 1e-5);
  EXPECT_NEAR(bright.reflectance.r / bright.reflectance.b, 4, 1e-5);
  EXPECT_EQ(bright.emission, (Rgb{17, 12, 4}));
  const Material mirror = OneMaterial("Kd 0 0 0\nKs 2 1 1\nillum 3\n");
  EXPECT_NEAR(mirror.reflectance.r, 1, 1e-5);
  EXPECT_NEAR(mirror.reflectance.g, 0.5, 1e-5);
  // One line tells of all of them, and none of what is left as it was.
  Write("b.mtl", "newmtl a\nKd 0.9 0 0\nKs 0.2 0 0\nillum 2\nnewmtl b\nKd 1 1 1\nillum 2\n");
  const auto file = Read("b.obj",
                         "mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\n"
                         "f 3 2 1\n");
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_THAT(file->notes, SizeIs(1));
  EXPECT_THAT(file->notes[0], ::testing::EndsWith("and are scaled down: \"a\""));
}

TEST_F(MeshFileTest, XzIsReadWithItsMaterialsPackedOrNot) {
  const std::string obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
  Write("a.mtl", "newmtl m\nKd 0.1 0.2 0.3\n");
  auto file = Read("a.obj.xz", Pack(obj));
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->materials[0].reflectance, (Rgb{0.1f, 0.2f, 0.3f}));
  std::filesystem::remove(folder_ + "/a.mtl");
  Write("a.mtl.xz", Pack("newmtl m\nKd 0.4 0.5 0.6\n"));
  file = Read("a.obj.xz", Pack(obj));
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->materials[0].reflectance, (Rgb{0.4f, 0.5f, 0.6f}));
}

TEST_F(MeshFileTest, BrokenXzIsNamed) {
  const std::string packed = Pack(kTriangle);
  EXPECT_THAT(Error("a.obj.xz", packed.substr(0, packed.size() - 9)), HasSubstr("ends early"));
  EXPECT_THAT(Error("a.obj.xz", ""), HasSubstr("ends early"));
  EXPECT_THAT(Error("a.obj.xz", kTriangle), HasSubstr("no xz file"));
  std::string damaged = packed;
  damaged[packed.size() / 2] ^= 0x55;
  EXPECT_THAT(Error("a.obj.xz", damaged), HasSubstr("damaged"));
}

TEST_F(MeshFileTest, UnpackingStopsAtTheLimit) {
  const std::string path = Write("zeros.xz", Pack(std::string(1 << 20, '\0')));
  EXPECT_EQ(ReadFileBytes(path, 1 << 20)->size(), 1u << 20);
  const auto bytes = ReadFileBytes(path, (1 << 20) - 1);
  EXPECT_EQ(bytes.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(bytes.status().message()), HasSubstr("more than 1048575 bytes"));
}

TEST_F(MeshFileTest, PlyIsReadInAsciiAndBinary) {
  const auto ascii =
      Read("a.ply",
           "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty "
           "float y\nproperty float z\nproperty uchar red\nelement face 2\nproperty "
           "list uchar int vertex_index\nend_header\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 "
           "9\n0.5 2 0 9\n4 0 1 2 3\n3 3 2 4\n");
  ASSERT_TRUE(ascii.ok()) << ascii.status();
  EXPECT_THAT(ascii->mesh.corners, SizeIs(3));
  EXPECT_NEAR(Area(ascii->mesh), 1.5, 1e-6);
  const auto binary = Read("b.ply", BinaryPly());
  ASSERT_TRUE(binary.ok()) << binary.status();
  EXPECT_THAT(binary->mesh.corners, SizeIs(2));
  EXPECT_NEAR(Area(binary->mesh), 1, 1e-6);
  EXPECT_EQ(binary->materials[0].name, "default");
}

TEST_F(MeshFileTest, BrokenPlySaysWhere) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  EXPECT_THAT(Error("a.ply", header + "0 0 0\n1 0 0\n"), HasSubstr("ends early, in vertex 2 of 3"));
  EXPECT_THAT(Error("a.ply", header + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n"),
              StartsWith("a.ply:11: vertex 1 of 3: expected one more number"));
  EXPECT_THAT(Error("a.ply", header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"),
              StartsWith("a.ply:13: face 0: vertex 7: there are 3"));
  EXPECT_THAT(Error("a.ply", header + "0 0 inf\n1 0 0\n0 1 0\n3 0 1 2\n"),
              StartsWith("a.ply:10: vertex 0: z is inf"));
  EXPECT_THAT(Error("a.ply", header + "0 0 0\n1 0 0\n0 1 0\n2 0 1\n"), HasSubstr("2 corners"));
  EXPECT_THAT(Error("a.ply",
                    "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\n"
                    "property float y\nproperty float z\nend_header\n0 0 0\n"),
              HasSubstr("ends early"));
  EXPECT_THAT(Error("a.ply", BinaryPly().substr(0, BinaryPly().size() - 1)),
              HasSubstr("ends early, in face 1 of 2"));
}

TEST_F(MeshFileTest, GltfIsReadWithItsTransforms) {
  const auto file = Read("a.gltf", Gltf());
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(file->mesh.corners, SizeIs(2));
  EXPECT_NEAR(Area(file->mesh), 4, 1e-5);
  for (const Vec3& vertex : file->mesh.vertices) EXPECT_EQ(vertex.z, 5);
  ASSERT_THAT(file->materials, SizeIs(1));
  const Material& copper = file->materials[0];
  EXPECT_EQ(copper.name, "copper");
  EXPECT_EQ(copper.surface, Surface::kGlossy);
  EXPECT_EQ(copper.specular, (Rgb{0.9f, 0.5f, 0.3f}));
  EXPECT_NEAR(copper.exponent, 2 / std::pow(0.5, 4) - 2, 1e-3);
  EXPECT_EQ(copper.emission, (Rgb{0, 0, 0.5f}));
}

TEST_F(MeshFileTest, BrokenGltfSaysWhere) {
  EXPECT_THAT(Error("a.gltf", "{\n \"asset\": {\"version\": }\n}"), StartsWith("a.gltf:2:"));
  EXPECT_THAT(Error("a.gltf", "{}"), HasSubstr("no glTF 2"));
  EXPECT_THAT(Error("a.gltf", std::string(100000, '[') + std::string(100000, ']')),
              HasSubstr("levels"));
  EXPECT_THAT(Error("a.gltf", R"({"asset": []})"), HasSubstr("no glTF 2"));
  EXPECT_THAT(Error("a.gltf", R"({"asset": {"version": "2.0"}, "buffers": {"a": 1}})"),
              HasSubstr("buffers is no array"));
  EXPECT_THAT(Error("a.gltf", R"({"asset": {"version": "2.0"}, "nodes": [{"children": "x"}]})"),
              HasSubstr("nodes[0].children"));
  EXPECT_THAT(Error("a.gltf", "1e999"), HasSubstr("number overflow"));
  std::string twice = Gltf();
  twice.replace(twice.find("\"nodes\": [{"), 11, "\"nodes\": [{\"children\": [1, 1]}, {");
  EXPECT_THAT(Error("a.gltf", twice), HasSubstr("nodes[1] has two parents"));
  std::string external = Gltf();
  const std::size_t uri = external.find("data:");
  external.replace(uri, external.find('"', uri) - uri, "gone.bin");
  const auto file = Read("a.gltf", external);
  EXPECT_EQ(file.status().code(), absl::StatusCode::kNotFound) << file.status();
  EXPECT_THAT(std::string(file.status().message()), HasSubstr("gone.bin"));
}

TEST_F(MeshFileTest, DegenerateTrianglesAreDroppedAndCounted) {
  const auto file = Read("a.obj", std::string(kTriangle) + "v 2 0 0\nf 1 2 4\nf 1 1 2\n");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(file->mesh.corners, SizeIs(1));
  EXPECT_EQ(file->degenerate_count, 2u);
  EXPECT_THAT(file->notes, ElementsAre(HasSubstr("2 triangles without area")));
  EXPECT_THAT(Error("b.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"),
              HasSubstr("no triangle with an area"));
}

/// A tent: two squares that meet at an edge, their normals `degrees` apart.
std::string Tent(double degrees) {
  const double a = degrees / 2 * std::acos(-1) / 180;
  return fmt::format(
      "v 0 0 0\nv 0 0 1\nv {0} {1} 1\nv {0} {1} 0\nv -{0} {1} 1\nv -{0} {1} 0\n"
      "f 1 2 3 4\nf 2 1 6 5\n",
      std::cos(a), -std::sin(a));
}

TEST_F(MeshFileTest, NormalsAreSmoothUpToTheCrease) {
  const auto smooth = Read("a.obj", Tent(30), {.crease_degrees = 40});
  ASSERT_TRUE(smooth.ok()) << smooth.status();
  ASSERT_THAT(smooth->mesh.normals, SizeIs(smooth->mesh.vertices.size()));
  int on_ridge = 0;
  for (std::size_t i = 0; i < smooth->mesh.vertices.size(); ++i) {
    if (smooth->mesh.vertices[i].x != 0) continue;
    ++on_ridge;
    EXPECT_NEAR(smooth->mesh.normals[i].y, 1, 1e-6);
  }
  EXPECT_EQ(on_ridge, 2);  // one vertex for both sides
  const auto creased = Read("a.obj", Tent(50), {.crease_degrees = 40});
  ASSERT_TRUE(creased.ok()) << creased.status();
  EXPECT_THAT(creased->mesh.normals, IsEmpty());
  const auto flat = Read("a.obj", Tent(30), {.normals = Normals::kFlat});
  EXPECT_THAT(flat->mesh.normals, IsEmpty());
}

TEST_F(MeshFileTest, NormalsOfTheFileAreKept) {
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0.6 0.8\nvn 0 0 2\nf 1//1 2//2 3//2\n";
  const auto file = Read("a.obj", obj);
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_THAT(file->mesh.normals, SizeIs(3));
  EXPECT_NEAR(file->mesh.normals[file->mesh.corners[0][0]].y, 0.6, 1e-6);
  EXPECT_NEAR(file->mesh.normals[file->mesh.corners[0][1]].z, 1, 1e-6);
  EXPECT_THAT(Read("a.obj", obj, {.normals = Normals::kSmooth})->mesh.normals, IsEmpty());
}

TEST_F(MeshFileTest, MaterialsCanBeDropped) {
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\n";
  const auto file = Read("a.obj", obj, {.dropped_materials = {"a"}});
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(file->mesh.corners, SizeIs(1));
  EXPECT_EQ(file->materials[0].name, "b");
  const auto none = Read("a.obj", obj, {.dropped_materials = {"c"}});
  EXPECT_THAT(std::string(none.status().message()), HasSubstr("it has no material \"c\""));
}

TEST_F(MeshFileTest, FilesThatAreNoneAreNamed) {
  EXPECT_EQ(ReadMeshFile(folder_ + "/gone.obj").status().code(), absl::StatusCode::kNotFound);
  std::filesystem::create_directories(folder_ + "/folder.obj");
  EXPECT_THAT(std::string(ReadMeshFile(folder_ + "/folder.obj").status().message()),
              HasSubstr("it is a folder"));
  ASSERT_EQ(mkfifo((folder_ + "/pipe.ply").c_str(), 0600), 0);  // opening it would wait for ever
  EXPECT_THAT(std::string(ReadMeshFile(folder_ + "/pipe.ply").status().message()),
              HasSubstr("pipe.ply: it is a pipe"));
  std::filesystem::create_symlink("/dev/zero", folder_ + "/zero.obj");
  EXPECT_THAT(std::string(ReadMeshFile(folder_ + "/zero.obj").status().message()),
              HasSubstr("zero.obj: it is a device"));
  EXPECT_THAT(Error("a.stl", "solid"), HasSubstr("ends in none of"));
}

}  // namespace
}  // namespace treelight::client
