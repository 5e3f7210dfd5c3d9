#ifndef TREELIGHT_SERVER_UNIX_SOCKET_H_
#define TREELIGHT_SERVER_UNIX_SOCKET_H_

#include <string_view>

#include "absl/status/status.h"

namespace treelight::server {

/// Whether a server may bind `listen`: any TCP address, or a Unix socket on which nobody answers.
/// gRPC replaces a socket file without a question, which is right for one that a dead process has
/// left behind. UNAVAILABLE: somebody answers there, or it is not known since this user may not
/// connect. Two servers that start in the same moment may both find the path free.
absl::Status CheckSocketIsFree(std::string_view listen);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_UNIX_SOCKET_H_
