#include "server/acceptor.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "server/break_switch.h"

namespace treelight::server {
namespace {

/// Before accept() is tried again that found no file or no memory.
constexpr int kPauseMs = 50;

/// Whether accept() failed for want of something, which may come back; any other error is of the
/// one connection that was to be taken up.
bool IsShortage(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

}  // namespace

Acceptor::Acceptor(ListeningSockets sockets, OpenConnections& connections, Take take)
    : sockets_(std::move(sockets)),
      connections_(connections),
      take_(std::move(take)),
      end_(eventfd(0, EFD_CLOEXEC)),
      thread_([this] { Serve(); }) {}

Acceptor::~Acceptor() {
  eventfd_write(end_.get(), 1);
  thread_.join();
}

void Acceptor::Serve() {
  std::vector<pollfd> waited = {{.fd = end_.get(), .events = POLLIN, .revents = 0}};
  for (const FileHandle& socket : sockets_.handles()) {
    waited.push_back({.fd = socket.get(), .events = POLLIN, .revents = 0});
  }
  while (true) {
    if (poll(waited.data(), waited.size(), -1) < 0) continue;  // EINTR
    if (waited[0].revents != 0) return;
    bool shortage = false;
    for (std::size_t i = 1; i < waited.size(); ++i) {
      if (waited[i].revents != 0) shortage |= !AcceptFrom(waited[i].fd);
    }
    if (shortage && Broken("connections")) return;
    // Those that wait stay in the socket's queue.
    if (shortage) poll(waited.data(), 1, kPauseMs);
  }
}

/// Takes up what waits at `socket`; false where there is no room for it.
bool Acceptor::AcceptFrom(int socket) {
  constexpr int kAtOnce = 64;  // then the other sockets
  for (int i = 0; i < kAtOnce; ++i) {
    FileHandle connection(accept4(socket, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (connection.get() >= 0) {
      if (connections_.Enter(connection.get())) {
        take_(std::move(connection));
      } else {
        Tell(
            "they are as many as allowed (--max-connections, or the limit of open files): further "
            "ones are closed");
      }
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      return true;
    } else if (IsShortage(errno)) {
      Tell(std::strerror(errno));
      return false;
    }
  }
  return true;
}

/// Says on stderr why a client is not served.
void Acceptor::Tell(const char* what) {
  line_.Tell(fmt::format("{} connections are open: {}", connections_.open(), what));
}

}  // namespace treelight::server
