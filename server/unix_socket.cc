#include "server/unix_socket.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "fmt/format.h"

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

}  // namespace

absl::Status CheckSocketIsFree(std::string_view listen) {
  if (!listen.starts_with("unix:")) return absl::OkStatus();
  std::string_view path = listen.substr(5);
  if (path.starts_with("//")) path.remove_prefix(2);  // gRPC takes unix:///path too
  const int error = TryConnect(path);
  // Not there, or a file that nobody listens on. In a missing folder the bind fails.
  if (error == ENOENT || error == ECONNREFUSED || error == ENOTDIR) return absl::OkStatus();
  return absl::UnavailableError(fmt::format(
      "cannot listen on '{}': {}", listen,
      error == 0 || error == EAGAIN ? "another process answers there" : std::strerror(error)));
}

}  // namespace treelight::server
