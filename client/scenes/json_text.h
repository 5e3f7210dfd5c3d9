#ifndef TREELIGHT_CLIENT_SCENES_JSON_TEXT_H_
#define TREELIGHT_CLIENT_SCENES_JSON_TEXT_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

namespace treelight::client {

/// Parses JSON of at most 64 levels; keys must not repeat. INVALID_ARGUMENT: it
/// is none; the message is "PATH:LINE:COLUMN: ...".
absl::StatusOr<nlohmann::json> ParseJson(std::string_view text, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_JSON_TEXT_H_
