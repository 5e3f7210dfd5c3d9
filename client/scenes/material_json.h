#ifndef TREELIGHT_CLIENT_SCENES_MATERIAL_JSON_H_
#define TREELIGHT_CLIENT_SCENES_MATERIAL_JSON_H_

#include <string_view>

#include "absl/status/status.h"
#include "client/scenes/json_object.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// Sets the fields of `material` that `json` has, by the names of Material. An error where one is
/// out of its range, or where reflectance and specular together are above 1.
void ReadMaterial(JsonObject& json, Material& material);

/// Sets one field of a material in words: "NAME:KEY=VALUE", KEY as in a scene file, VALUE a word, a
/// number or three separated by commas; all materials of that name. INVALID_ARGUMENT: it is not of
/// that form, or the value is wrong. NOT_FOUND: there is no such material; the message lists them.
absl::Status OverrideMaterial(std::string_view assignment, Scene& scene);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_MATERIAL_JSON_H_
