#ifndef TREELIGHT_CLIENT_SCENES_REGISTRY_H_
#define TREELIGHT_CLIENT_SCENES_REGISTRY_H_

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// Names of the scenes that are built in.
std::vector<std::string> BuiltInScenes();

/// Makes the built-in scene `name`. NOT_FOUND: there is none; the message lists those there are.
absl::StatusOr<Scene> MakeScene(std::string_view name);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_REGISTRY_H_
