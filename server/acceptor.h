#ifndef TREELIGHT_SERVER_ACCEPTOR_H_
#define TREELIGHT_SERVER_ACCEPTOR_H_

#include <functional>
#include <thread>

#include "server/file_handle.h"
#include "server/listening_sockets.h"
#include "server/open_connections.h"
#include "server/rare_line.h"

namespace treelight::server {

/// Takes up the connections of clients. gRPC's own listener (1.51) ends for good at the first
/// accept() that fails, so that a process that was once short of files never served a new client
/// again; this one waits until there is room, and keeps --max-connections.
class Acceptor {
 public:
  /// Gets each connection, which it owns, on the acceptor's thread.
  using Take = std::function<void(FileHandle connection)>;

  /// `connections` outlives it. Where none more may be open, the next is closed at once, which
  /// stderr tells now and then.
  Acceptor(ListeningSockets sockets, OpenConnections& connections, Take take);

  /// From here on nobody can connect, and `take` is not called.
  ~Acceptor();

  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

 private:
  void Serve();
  bool AcceptFrom(int socket);
  void Tell(const char* what);

  const ListeningSockets sockets_;
  OpenConnections& connections_;
  const Take take_;
  const FileHandle end_;  // an eventfd: readable once the thread shall end
  RareLine line_;
  std::thread thread_;  // last: uses the rest
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_ACCEPTOR_H_
