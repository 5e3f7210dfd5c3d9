#ifndef TREELIGHT_CLIENT_COMMANDS_BUILD_REPORT_H_
#define TREELIGHT_CLIENT_COMMANDS_BUILD_REPORT_H_

#include "absl/status/status.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::client {

/// Prints what the server says of a map that it has built: the map, its tree, the stages of the
/// build and where the time went; or all of it as JSON.
absl::Status PrintBuildReport(const v1::BuildPhotonMapResponse& built, bool json);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_BUILD_REPORT_H_
