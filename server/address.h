#ifndef TREELIGHT_SERVER_ADDRESS_H_
#define TREELIGHT_SERVER_ADDRESS_H_

#include <string>
#include <string_view>

#include "absl/status/status.h"

namespace treelight::server {

/// Checks `listen`: "host:port", the host a name, an IPv4 or a bracketed IPv6 address, the port [0,
/// 65535]; or "unix:/path". INVALID_ARGUMENT says what is wrong.
absl::Status CheckAddress(std::string_view listen);

/// Whether only this machine can reach `listen`: a Unix socket, localhost, 127.0.0.0/8, [::1].
bool IsLocal(std::string_view listen);

/// The host of "host:port", without brackets.
std::string HostOf(std::string_view listen);

/// The port of "host:port" that CheckAddress took.
int PortOf(std::string_view listen);

/// `listen` with the port that was bound; a Unix socket stays as it is.
std::string WithPort(std::string_view listen, int port);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_ADDRESS_H_
