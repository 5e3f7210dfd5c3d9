#ifndef TREELIGHT_CLIENT_SCENES_MESH_MATERIAL_H_
#define TREELIGHT_CLIENT_SCENES_MESH_MATERIAL_H_

#include "client/scenes/scene.h"

struct aiMaterial;

namespace treelight::client {

/// Scales reflectance and specular down together, where a channel of their sum is above 1, so that
/// it becomes 1: a surface gives no energy.
void LimitReflectance(Material& material);

/// What a material of an OBJ's MTL file means; docs/scenes.md has the rules. Numbers are finite and
/// not negative.
Material TranslateMtl(const aiMaterial& source);

/// What a material of a glTF means; docs/scenes.md has the rules.
Material TranslateGltf(const aiMaterial& source);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_MESH_MATERIAL_H_
