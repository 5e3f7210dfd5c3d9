#ifndef TREELIGHT_TESTS_MESH_FILES_H_
#define TREELIGHT_TESTS_MESH_FILES_H_

#include <lzma.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/escaping.h"
#include "client/scenes/mesh_file.h"
#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::testing {

/// `bytes` as a file of xz.
inline std::string Pack(const std::string& bytes) {
  std::string packed(lzma_stream_buffer_bound(bytes.size()), '\0');
  std::size_t size = 0;
  const lzma_ret code = lzma_easy_buffer_encode(
      6, LZMA_CHECK_CRC64, nullptr, reinterpret_cast<const std::uint8_t*>(bytes.data()),
      bytes.size(), reinterpret_cast<std::uint8_t*>(packed.data()), &size, packed.size());
  EXPECT_EQ(code, LZMA_OK);
  packed.resize(size);
  return packed;
}

/// An OBJ.
inline constexpr char kTriangle[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A square of two triangles as a binary PLY.
inline std::string BinaryPly() {
  std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float "
      "y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n";
  const std::array<float, 12> positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  ply.append(reinterpret_cast<const char*>(positions.data()), sizeof(positions));
  for (const std::array<std::int32_t, 3>& face :
       {std::array<std::int32_t, 3>{0, 1, 2}, {0, 2, 3}}) {
    ply.push_back(3);
    ply.append(reinterpret_cast<const char*>(face.data()), sizeof(face));
  }
  return ply;
}

/// A unit square of two triangles: its positions, then its indices.
inline std::string SquareBuffer() {
  std::string buffer;
  const std::array<float, 12> positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const std::array<std::uint16_t, 6> indices = {0, 1, 2, 0, 2, 3};
  buffer.append(reinterpret_cast<const char*>(positions.data()), sizeof(positions));
  buffer.append(reinterpret_cast<const char*>(indices.data()), sizeof(indices));
  return buffer;
}

/// The square, twice as large by its node, made of copper; `uri` is that of its buffer.
inline std::string GltfWith(const std::string& uri) {
  return R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
  "nodes": [{"mesh": 0, "scale": [2, 2, 2], "translation": [0, 0, 5]}],
  "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
  "materials": [{"name": "copper", "emissiveFactor": [0, 0, 0.5], "pbrMetallicRoughness":
    {"baseColorFactor": [0.9, 0.5, 0.3, 1], "metallicFactor": 1, "roughnessFactor": 0.5}}],
  "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                  {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
  "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                 "min": [0, 0, 0], "max": [1, 1, 0]},
                {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
  "buffers": [{"byteLength": 60)" +
         uri + "}]}";
}

/// With its buffer inside, as text.
inline std::string Gltf() {
  return GltfWith(fmt::format(R"(, "uri": "data:application/octet-stream;base64,{}")",
                              absl::Base64Escape(SquareBuffer())));
}

/// With its buffer inside, as binary.
inline std::string Glb() {
  std::string json = GltfWith("");
  json.append((4 - json.size() % 4) % 4, ' ');
  const auto word = [](std::size_t value) {
    const auto w = static_cast<std::uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&w), 4);
  };
  const std::string buffer = SquareBuffer();
  const std::string chunks =
      word(json.size()) + "JSON" + json + word(buffer.size()) + std::string("BIN\0", 4) + buffer;
  return "glTF" + word(2) + word(12 + chunks.size()) + chunks;
}

/// A folder of its own for each test.
class MeshFiles : public ::testing::Test {
 protected:
  MeshFiles() : folder_(::testing::TempDir() + fmt::format("mesh_files.{}", getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~MeshFiles() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ + "/" + name, std::ios::binary) << bytes;
    return folder_ + "/" + name;
  }
  absl::StatusOr<client::MeshFile> Read(const std::string& name, const std::string& bytes,
                                        const client::MeshFileOptions& options = {}) const {
    return client::ReadMeshFile(Write(name, bytes), options);
  }
  /// The message of a file that must be refused, without the folder.
  std::string Error(const std::string& name, const std::string& bytes) const {
    const auto file = Read(name, bytes);
    EXPECT_EQ(file.status().code(), absl::StatusCode::kInvalidArgument) << file.status();
    const std::string message(file.status().message());
    EXPECT_THAT(message, ::testing::StartsWith(folder_ + "/"));
    return message.substr(std::min(folder_.size() + 1, message.size()));
  }
  /// The material of an OBJ with one triangle, of MTL text `fields`.
  client::Material OneMaterial(const std::string& fields) const {
    Write("m.mtl", "newmtl m\n" + fields);
    const auto file = Read("m.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    EXPECT_TRUE(file.ok()) << file.status();
    if (!file.ok() || file->materials.size() != 1) return {};
    EXPECT_THAT(file->notes, ::testing::Each(::testing::HasSubstr("scaled down")));
    return file->materials[0];
  }

  const std::string folder_;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_MESH_FILES_H_
