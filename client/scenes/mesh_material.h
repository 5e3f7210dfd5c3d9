#ifndef TREELIGHT_CLIENT_SCENES_MESH_MATERIAL_H_
#define TREELIGHT_CLIENT_SCENES_MESH_MATERIAL_H_

#include "client/scenes/scene.h"

struct aiMaterial;

namespace treelight::client {

/// A material of a file.
struct TranslatedMaterial {
  Material material;
  bool scaled = false;  ///< the file has one that gives energy: its reflectances were scaled down
};

/// What a material of an OBJ's MTL file means; docs/scenes.md has the rules. Numbers are finite and
/// not negative.
TranslatedMaterial TranslateMtl(const aiMaterial& source);

/// What a material of a glTF means; docs/scenes.md has the rules.
TranslatedMaterial TranslateGltf(const aiMaterial& source);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_MESH_MATERIAL_H_
