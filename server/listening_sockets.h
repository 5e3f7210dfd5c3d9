#ifndef TREELIGHT_SERVER_LISTENING_SOCKETS_H_
#define TREELIGHT_SERVER_LISTENING_SOCKETS_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/file_handle.h"

namespace treelight::server {

/// Where clients connect to: one socket for each address of a host. They do not block.
class ListeningSockets {
 public:
  /// Binds `listen`, an address that CheckAddress took; clients may connect from now on. Port 0 is
  /// a free one. 0.0.0.0 and [::] are all interfaces, of IPv4 and, where there is it, IPv6. The
  /// file of a Unix socket never has more permissions than `socket_mode`, and replaces one that
  /// nobody listens on: the caller has the SocketLock. UNAVAILABLE: it cannot be bound.
  static absl::StatusOr<ListeningSockets> Bind(const std::string& listen, unsigned socket_mode);

  ListeningSockets() = default;
  ListeningSockets(ListeningSockets&& other) noexcept = default;
  ListeningSockets& operator=(ListeningSockets&& other) noexcept = default;
  /// Takes the file of a Unix socket with it.
  ~ListeningSockets();

  const std::vector<FileHandle>& handles() const { return handles_; }
  int port() const { return port_; }  ///< 0 of a Unix socket

 private:
  absl::Status BindUnix(const std::string& listen, const std::string& path, unsigned mode);
  absl::Status BindTcp(const std::string& listen);

  std::vector<FileHandle> handles_;
  int port_ = 0;
  std::string path_;  // of a Unix socket that is bound
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_LISTENING_SOCKETS_H_
