#ifndef TREELIGHT_CLIENT_SCENES_GLTF_CHECK_H_
#define TREELIGHT_CLIENT_SCENES_GLTF_CHECK_H_

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace treelight::client {

/// Checks what Assimp does not say or would fall over: the chunks of a GLB, the syntax of the JSON,
/// its version, and that the nodes are trees. Gives the names of the files that its buffers are in.
/// INVALID_ARGUMENT: it is broken; the message begins with `path`.
absl::StatusOr<std::vector<std::string>> CheckGltf(std::string_view bytes, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_GLTF_CHECK_H_
