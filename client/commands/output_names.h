#ifndef TREELIGHT_CLIENT_COMMANDS_OUTPUT_NAMES_H_
#define TREELIGHT_CLIENT_COMMANDS_OUTPUT_NAMES_H_

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace treelight::client {

/// The outputs of a gather, bits of kOutput, by what --outputs calls them: "count", "radius",
/// "neighbors", "density", "statistics", "error-bound".
const std::map<std::string, std::uint32_t>& OutputNames();

/// The mask of outputs that are all in OutputNames().
std::uint32_t OutputMask(const std::vector<std::string>& names);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_OUTPUT_NAMES_H_
