#include "tests/faults/proxy.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <vector>

#include "fmt/format.h"

namespace treelight::faults {
namespace {

constexpr int kPollMs = 20;

sockaddr_in Loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

bool SendAll(int handle, const char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t sent = send(handle, bytes, count, MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes += sent;
    count -= static_cast<std::size_t>(sent);
  }
  return true;
}

}  // namespace

/// A client's connection and the one to the server that belongs to it.
struct Proxy::Connection {
  static constexpr std::int64_t kUncut = -1;

  int client = -1, server = -1;
  std::atomic<std::int64_t> cut_requests = kUncut, cut_answers = kUncut;  // bytes still to go
  std::atomic<int> pumping = 2;
  std::thread requests, answers;

  ~Connection() {
    if (requests.joinable()) requests.join();
    if (answers.joinable()) answers.join();
    close(client);
    close(server);
  }
  /// Both ends see a reset, as of a machine that has gone.
  void Break() const {
    const linger now{.l_onoff = 1, .l_linger = 0};
    for (const int handle : {client, server}) {
      setsockopt(handle, SOL_SOCKET, SO_LINGER, &now, sizeof(now));
      shutdown(handle, SHUT_RDWR);
    }
  }
};

Proxy::Proxy(Recorder& recorder, Options options) : recorder_(recorder), options_(options) {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  bind(listener_, reinterpret_cast<const sockaddr*>(&address), size);
  constexpr int kBacklog = 64;
  listen(listener_, kBacklog);
  getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
  acceptor_ = std::thread([this] { Accept(); });
}

Proxy::~Proxy() {
  over_ = true;
  acceptor_.join();
  SetServer(0);
  close(listener_);
}

std::string Proxy::address() const { return fmt::format("127.0.0.1:{}", port_); }

void Proxy::SetServer(int port) {
  server_port_ = port;
  if (port != 0) return;
  const std::lock_guard lock(mutex_);
  for (const auto& connection : connections_) connection->Break();
  connections_.clear();  // waits for their threads
}

bool Proxy::Cut(std::uint32_t choice, bool answers, std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  if (connections_.empty()) return false;
  Connection& chosen = **std::next(connections_.begin(), choice % connections_.size());
  (answers ? chosen.cut_answers : chosen.cut_requests) = bytes;
  return true;
}

void Proxy::Accept() {
  while (!over_) {
    pollfd ready{.fd = listener_, .events = POLLIN, .revents = 0};
    if (poll(&ready, 1, kPollMs) <= 0) continue;
    const std::lock_guard lock(mutex_);
    std::erase_if(connections_, [](const auto& connection) { return connection->pumping == 0; });
    const int port = server_port_;
    if (port == 0) {
      usleep(1000 * kPollMs);
      continue;
    }
    auto connection = std::make_unique<Connection>();
    connection->client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    connection->server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (options_.piece_bytes > 0) {
      const int small = static_cast<int>(options_.piece_bytes);
      setsockopt(connection->server, SOL_SOCKET, SO_RCVBUF, &small, sizeof(small));
    }
    const sockaddr_in address = Loopback(port);
    const bool reached = connection->client >= 0 &&
                         connect(connection->server, reinterpret_cast<const sockaddr*>(&address),
                                 sizeof(address)) == 0;
    if (!reached) continue;
    const int on = 1;  // small messages go at once
    setsockopt(connection->client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    setsockopt(connection->server, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    connection->requests = std::thread([this, &c = *connection] { Pump(c, false); });
    connection->answers = std::thread([this, &c = *connection] { Pump(c, true); });
    connections_.push_back(std::move(connection));
  }
}

void Proxy::Pump(Connection& connection, bool answers) {
  const int from = answers ? connection.server : connection.client;
  const int to = answers ? connection.client : connection.server;
  auto& cut = answers ? connection.cut_answers : connection.cut_requests;
  const bool slow = answers && options_.piece_bytes > 0;
  std::vector<char> buffer(slow ? options_.piece_bytes : 1 << 16);
  while (true) {
    const ssize_t received = recv(from, buffer.data(), buffer.size(), 0);
    if (received <= 0) break;
    auto count = static_cast<std::size_t>(received);
    const std::int64_t left = cut;
    if (left >= 0) {
      count = std::min(count, static_cast<std::size_t>(left));
      cut = left - static_cast<std::int64_t>(count);
    }
    if (!SendAll(to, buffer.data(), count)) break;
    if (left >= 0 && cut == 0) {
      const Time start = recorder_.Now();
      connection.Break();
      recorder_.AddCut({start, recorder_.Now()});
      break;
    }
    if (slow) std::this_thread::sleep_for(options_.pause);
  }
  connection.Break();
  --connection.pumping;
}

}  // namespace treelight::faults
