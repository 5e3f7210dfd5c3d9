#include "server/unix_socket.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"

namespace treelight::server {
namespace {

/// The error of a connect() to `path`, 0 where it succeeds. Does not wait for the other side.
int TryConnect(std::string_view path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) return ENOENT;  // too long: gRPC refuses it
  std::ranges::copy(path, address.sun_path);
  const int handle = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (handle < 0) return errno;
  const int error =
      connect(handle, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ? 0
                                                                                         : errno;
  close(handle);
  return error;
}

absl::Status CannotListen(std::string_view listen, std::string_view why) {
  return absl::UnavailableError(fmt::format("cannot listen on '{}': {}", listen, why));
}

/// Whether somebody answers at `path`, a server that holds no lock say.
absl::Status CheckSocketIsFree(std::string_view listen, std::string_view path) {
  const int error = TryConnect(path);
  // Not there, or a file that nobody listens on.
  if (error == ENOENT || error == ECONNREFUSED || error == ENOTDIR) return absl::OkStatus();
  return CannotListen(listen, error == 0 || error == EAGAIN ? "another process answers there"
                                                            : std::strerror(error));
}

}  // namespace

std::string SocketPath(std::string_view listen) {
  if (!listen.starts_with("unix:")) return {};
  listen.remove_prefix(5);
  if (listen.starts_with("//")) listen.remove_prefix(2);  // gRPC takes unix:///path too
  return std::string(listen);
}

absl::StatusOr<SocketLock> SocketLock::Take(std::string_view listen) {
  const std::string path = SocketPath(listen);
  if (path.empty() || Broken("socket_lock")) return SocketLock();
  struct stat there {};
  if (lstat(path.c_str(), &there) == 0 && !S_ISSOCK(there.st_mode)) {
    return CannotListen(listen, "what is there is no socket, and is left alone");
  }
  const std::string file = fmt::format("{}.lock", path);
  SocketLock lock(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (lock.handle_ < 0) {
    return CannotListen(listen, fmt::format("'{}': {}", file, std::strerror(errno)));
  }
  if (flock(lock.handle_, LOCK_EX | LOCK_NB) != 0) {
    return CannotListen(listen, fmt::format("another process holds '{}'", file));
  }
  if (auto status = CheckSocketIsFree(listen, path); !status.ok()) return status;
  return lock;
}

SocketLock::SocketLock(SocketLock&& other) noexcept : handle_(std::exchange(other.handle_, -1)) {}

SocketLock& SocketLock::operator=(SocketLock&& other) noexcept {
  std::swap(handle_, other.handle_);
  return *this;
}

SocketLock::~SocketLock() {
  if (handle_ >= 0) close(handle_);
}

}  // namespace treelight::server
