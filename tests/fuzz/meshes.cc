// The readers of meshes and scene files: the first byte says which.
#include <cmath>
#include <cstdint>
#include <string>

#include "client/scenes/mesh_file.h"
#include "client/scenes/scene_file.h"
#include "tests/fuzz/require.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace treelight;
  if (size == 0) return 0;
  constexpr const char* kPaths[] = {"/nowhere/mesh.ply", "/nowhere/mesh.obj", "/nowhere/mesh.gltf",
                                    "/nowhere/mesh.glb"};
  std::string bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  if (data[0] % 5 == 4) {
    const auto scene = client::ParseSceneFile(bytes, "/nowhere/scene.json");
    if (!scene.ok()) fuzz::RequireRefusal(scene.status());
    return 0;
  }
  const auto file = client::ParseMesh(std::move(bytes), kPaths[data[0] % 5]);
  if (!file.ok()) fuzz::RequireRefusal(file.status());
  return 0;
}
