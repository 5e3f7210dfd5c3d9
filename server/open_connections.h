#ifndef TREELIGHT_SERVER_OPEN_CONNECTIONS_H_
#define TREELIGHT_SERVER_OPEN_CONNECTIONS_H_

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

namespace treelight::server {

/// A socket that somebody else owns and closes.
struct SocketId {
  /// Of the socket whose handle that is now; none where it is no open file.
  static std::optional<SocketId> Of(int handle);

  bool IsOpen() const;  ///< whether `handle` stands for it still; a system call

  int handle = -1;
  std::uint64_t device = 0, inode = 0;  // of the socket: handles are used again
};

/// Counts the connections of clients. gRPC closes them and tells nobody: a connection is open as
/// long as its handle stands for the same socket. Safe to call from several threads at once.
class OpenConnections {
 public:
  /// Of at most `limit`.
  explicit OpenConnections(std::size_t limit) : limit_(limit) {}

  /// Counts a connection in, whose handle that is; false, and not counted: `limit` are open, or
  /// were some milliseconds ago.
  bool Enter(int handle);

  std::size_t open() const;  ///< a system call for each

  std::size_t limit() const { return limit_; }

 private:
  const std::size_t limit_;
  mutable std::mutex mutex_;
  std::vector<SocketId> sockets_;  // guarded by mutex_; closed ones too, until they are looked for
  std::chrono::steady_clock::time_point looked_;  // guarded by mutex_; when they were
};

/// How many connections of `wanted` the process has files for, at least 1: some are kept for
/// snapshots, logs and the device.
std::size_t AffordableConnections(std::size_t wanted);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_OPEN_CONNECTIONS_H_
