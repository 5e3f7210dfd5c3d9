#include "server/open_connections.h"

#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>

#include "server/break_switch.h"

namespace treelight::server {

std::optional<SocketId> SocketId::Of(int handle) {
  struct stat status {};
  if (fstat(handle, &status) != 0) return std::nullopt;
  return SocketId{.handle = handle, .device = status.st_dev, .inode = status.st_ino};
}

bool SocketId::IsOpen() const {
  const auto now = Of(handle);
  return now && now->device == device && now->inode == inode;
}

bool OpenConnections::Enter(int handle) {
  const auto socket = SocketId::Of(handle);
  if (!socket) return false;
  const std::lock_guard lock(mutex_);
  // Who is refused must not cost a look at all the others each time.
  constexpr std::chrono::milliseconds kBetweenLooks{20};
  const auto now = std::chrono::steady_clock::now();
  if (sockets_.size() >= limit_ && now - looked_ >= kBetweenLooks) {
    std::erase_if(sockets_, [](const SocketId& known) { return !known.IsOpen(); });
    looked_ = now;
  }
  if (sockets_.size() >= limit_ && !Broken("connections")) return false;
  sockets_.push_back(*socket);
  return true;
}

std::size_t OpenConnections::open() const {
  const std::lock_guard lock(mutex_);
  return std::ranges::count_if(sockets_, &SocketId::IsOpen);
}

std::size_t AffordableConnections(std::size_t wanted) {
  constexpr rlim_t kLeastKept = 32, kMostKept = 256;
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur == RLIM_INFINITY) return wanted;
  const rlim_t kept = std::clamp(files.rlim_cur / 4, kLeastKept, kMostKept);
  return std::min<std::size_t>(wanted, files.rlim_cur > kept ? files.rlim_cur - kept : 1);
}

}  // namespace treelight::server
