#ifndef TREELIGHT_SERVER_UNIX_SOCKET_H_
#define TREELIGHT_SERVER_UNIX_SOCKET_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace treelight::server {

/// The path of "unix:/path"; empty of any other address.
std::string SocketPath(std::string_view listen);

/// The right to bind a Unix socket. Two servers that start in the same instant would both find the
/// path free, and gRPC replaces a socket file without a question: so the one that binds holds a
/// lock (flock) on PATH.lock, which the system lets go of when the process ends, however it does.
/// The file stays.
class SocketLock {
 public:
  /// Of "unix:/path"; of any other address one that holds nothing. UNAVAILABLE: another process
  /// holds the lock, somebody answers on the socket, another file has its path, or this user may
  /// not know.
  static absl::StatusOr<SocketLock> Take(std::string_view listen);

  SocketLock() = default;
  SocketLock(SocketLock&& other) noexcept;
  SocketLock& operator=(SocketLock&& other) noexcept;
  ~SocketLock();

 private:
  explicit SocketLock(int handle) : handle_(handle) {}
  int handle_ = -1;  // of the open lock file
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_UNIX_SOCKET_H_
