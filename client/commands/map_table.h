#ifndef TREELIGHT_CLIENT_COMMANDS_MAP_TABLE_H_
#define TREELIGHT_CLIENT_COMMANDS_MAP_TABLE_H_

#include <string>

#include "treelight/v1/photon_map.pb.h"

namespace treelight::client {

/// All that is known of a map as lines: what it holds, its tree, and a table of the stages of its
/// build.
std::string FormatMap(const v1::PhotonMap& map);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_MAP_TABLE_H_
