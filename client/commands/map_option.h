#ifndef TREELIGHT_CLIENT_COMMANDS_MAP_OPTION_H_
#define TREELIGHT_CLIENT_COMMANDS_MAP_OPTION_H_

#include <string>

#include "CLI/CLI.hpp"
#include "client/photon_map_client.h"

namespace treelight::client {

/// Adds the option `name` ("--map", or "map" for a positional one) to `command`: NAME means version
/// 0, NAME@VERSION that version. It is parsed to `map`, which must outlive the parsing.
CLI::Option* AddMapOption(CLI::App& command, const std::string& name, MapRef& map);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_MAP_OPTION_H_
