#ifndef TREELIGHT_CLIENT_BUILD_NAMES_H_
#define TREELIGHT_CLIENT_BUILD_NAMES_H_

#include <string>
#include <string_view>
#include <vector>

#include "treelight/v1/photon_map.pb.h"

// What people call builders and heuristics: the names of PhotonMap.builder.
namespace treelight::client {

/// "lbvh", "treelet", "hybrid", "trbvh", "atrbvh", "balanced", "karras", and "sah", "isa",
/// "vvh" for a top-down sweep by that heuristic.
std::vector<std::string> BuilderNames();

/// "sah", "isa", "vvh".
std::vector<std::string> HeuristicNames();

/// Sets the builder, and for a sweep the heuristic. False: there is no such builder.
bool SetBuilder(std::string_view name, v1::BuildOptions& options);

/// HEURISTIC_UNSPECIFIED: there is no such heuristic.
v1::Heuristic HeuristicNamed(std::string_view name);

/// "sah", "isa", "vvh"; empty for HEURISTIC_UNSPECIFIED and what this client does not know.
std::string NameOf(v1::Heuristic heuristic);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_BUILD_NAMES_H_
