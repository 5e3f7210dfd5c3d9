#include "server/listening_sockets.h"

#include <netdb.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "fmt/format.h"
#include "server/address.h"
#include "server/break_switch.h"
#include "server/unix_socket.h"

namespace treelight::server {
namespace {

/// What is sent and not acknowledged for so long ends a connection, ms.
constexpr int kUserTimeoutMs = 20'000;

absl::Status CannotListen(std::string_view listen, std::string_view why) {
  return absl::UnavailableError(fmt::format("cannot listen on '{}': {}", listen, why));
}

FileHandle MakeSocket(int family) {
  return FileHandle(socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

void SetOption(const FileHandle& handle, int level, int option, int value) {
  setsockopt(handle.get(), level, option, &value, sizeof(value));
}

/// A TCP socket that listens on `address`; connections have its options. Empty with errno set where
/// there can be none.
FileHandle ListenOn(const sockaddr* address, socklen_t bytes, bool ipv4_too) {
  FileHandle handle = MakeSocket(address->sa_family);
  if (handle.get() < 0) return handle;
  SetOption(handle, SOL_SOCKET, SO_REUSEADDR, 1);  // but for one that listens still
  SetOption(handle, IPPROTO_TCP, TCP_NODELAY, 1);
  SetOption(handle, IPPROTO_TCP, TCP_USER_TIMEOUT, kUserTimeoutMs);
  if (address->sa_family == AF_INET6)
    SetOption(handle, IPPROTO_IPV6, IPV6_V6ONLY, ipv4_too ? 0 : 1);
  if (bind(handle.get(), address, bytes) == 0 && listen(handle.get(), SOMAXCONN) == 0) {
    return handle;
  }
  const int error = errno;
  handle = FileHandle();
  errno = error;
  return handle;
}

/// The port of a socket that is bound.
int PortOf(const FileHandle& handle) {
  sockaddr_storage address{};
  socklen_t bytes = sizeof(address);
  if (getsockname(handle.get(), reinterpret_cast<sockaddr*>(&address), &bytes) != 0) return 0;
  return ntohs(address.ss_family == AF_INET6
                   ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                   : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

void SetPort(sockaddr* address, int port) {
  const auto number = htons(static_cast<std::uint16_t>(port));
  if (address->sa_family == AF_INET6) {
    reinterpret_cast<sockaddr_in6*>(address)->sin6_port = number;
  } else {
    reinterpret_cast<sockaddr_in*>(address)->sin_port = number;
  }
}

}  // namespace

absl::StatusOr<ListeningSockets> ListeningSockets::Bind(const std::string& listen,
                                                        unsigned socket_mode) {
  ListeningSockets sockets;
  const std::string path = SocketPath(listen);
  const auto status =
      path.empty() ? sockets.BindTcp(listen) : sockets.BindUnix(listen, path, socket_mode);
  if (!status.ok()) return status;
  return sockets;
}

ListeningSockets::~ListeningSockets() {
  if (!handles_.empty() && !path_.empty()) unlink(path_.c_str());
}

absl::Status ListeningSockets::BindUnix(const std::string& listen, const std::string& path,
                                        unsigned mode) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    return CannotListen(listen, fmt::format("the path has {} characters, at most {} are possible",
                                            path.size(), sizeof(address.sun_path) - 1));
  }
  std::ranges::copy(path, address.sun_path);
  FileHandle handle = MakeSocket(AF_UNIX);
  if (handle.get() < 0) return CannotListen(listen, std::strerror(errno));
  struct stat there {};
  if (lstat(path.c_str(), &there) == 0 && S_ISSOCK(there.st_mode)) unlink(path.c_str());
  // The file gets the mode of the socket without what umask takes, which chmod gives back.
  if (Broken("socket_mode")) mode = 0666;
  if (fchmod(handle.get(), mode) != 0 ||
      bind(handle.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    return CannotListen(listen, std::strerror(errno));
  }
  path_ = path;
  if (chmod(path.c_str(), mode) != 0 || ::listen(handle.get(), SOMAXCONN) != 0) {
    return CannotListen(listen, std::strerror(errno));
  }
  handles_.push_back(std::move(handle));
  return absl::OkStatus();
}

absl::Status ListeningSockets::BindTcp(const std::string& listen) {
  std::string host = HostOf(listen);
  const bool everywhere = host == "0.0.0.0" || host == "::";
  if (everywhere) {
    sockaddr_in6 any{};
    any.sin6_family = AF_INET6;
    any.sin6_port = htons(static_cast<std::uint16_t>(PortOf(listen)));
    auto handle = ListenOn(reinterpret_cast<const sockaddr*>(&any), sizeof(any), /*ipv4_too=*/true);
    if (handle.get() < 0 && errno == EADDRINUSE) return CannotListen(listen, std::strerror(errno));
    if (handle.get() >= 0) {
      port_ = PortOf(handle);
      handles_.push_back(std::move(handle));
      return absl::OkStatus();
    }
    host = "0.0.0.0";  // a machine without IPv6
  }
  addrinfo hints{}, *found = nullptr;
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  if (const int error = getaddrinfo(host.c_str(), nullptr, &hints, &found); error != 0) {
    return CannotListen(listen, gai_strerror(error));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  port_ = PortOf(listen);
  int error = EADDRNOTAVAIL;
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    SetPort(one->ai_addr, port_);  // the same for all, also where it is a free one
    auto handle = ListenOn(one->ai_addr, one->ai_addrlen, /*ipv4_too=*/false);
    if (handle.get() >= 0) {
      port_ = PortOf(handle);
      handles_.push_back(std::move(handle));
      continue;
    }
    error = errno;
    // Of localhost, [::1] may be missing; that another program has it must not go unnoticed.
    if (error == EADDRINUSE && PortOf(listen) != 0)
      return CannotListen(listen, std::strerror(error));
  }
  return handles_.empty() ? CannotListen(listen, std::strerror(error)) : absl::OkStatus();
}

}  // namespace treelight::server
