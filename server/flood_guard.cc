#include "server/flood_guard.h"

#include <arpa/inet.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "server/break_switch.h"

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace treelight::server {
namespace {

/// Between two looks at what connections have sent.
constexpr std::chrono::milliseconds kBetweenLooks{50};
/// After a flood calls are still to end, and their memory to be given back.
constexpr std::chrono::seconds kAftermath{10};
/// All connections together send as much between two looks without a flood.
constexpr std::uint64_t kFewBytes = 1 << 20;

/// "127.0.0.1:50000" or "[::1]:50000" of who is at the other end of `handle`; empty where that is
/// no address of IP.
std::string AddressOf(int handle) {
  sockaddr_storage address{};
  socklen_t bytes = sizeof(address);
  if (getpeername(handle, reinterpret_cast<sockaddr*>(&address), &bytes) != 0) return {};
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (address.ss_family == AF_INET) {
    const auto& ipv4 = reinterpret_cast<const sockaddr_in&>(address);
    inet_ntop(AF_INET, &ipv4.sin_addr, text.data(), text.size());
    return fmt::format("{}:{}", text.data(), ntohs(ipv4.sin_port));
  }
  if (address.ss_family != AF_INET6) return {};
  const auto& ipv6 = reinterpret_cast<const sockaddr_in6&>(address);
  if (IN6_IS_ADDR_V4MAPPED(&ipv6.sin6_addr)) {  // gRPC calls it what it is
    inet_ntop(AF_INET, &ipv6.sin6_addr.s6_addr[12], text.data(), text.size());
    return fmt::format("{}:{}", text.data(), ntohs(ipv6.sin6_port));
  }
  inet_ntop(AF_INET6, &ipv6.sin6_addr, text.data(), text.size());
  return fmt::format("[{}]:{}", text.data(), ntohs(ipv6.sin6_port));
}

/// The same of "ipv4:127.0.0.1:50000" or "ipv6:%5B::1%5D:50000".
std::string AddressOf(std::string_view peer) {
  if (!peer.starts_with("ipv4:") && !peer.starts_with("ipv6:")) return {};
  std::string address(peer.substr(5));
  for (const auto& [encoded, plain] : {std::pair{"%5B", "["}, {"%5D", "]"}}) {
    if (const std::size_t at = address.find(encoded); at != address.npos)
      address.replace(at, 3, plain);
  }
  return address;
}

/// What has come over the connection since it was opened, bytes; 0 where nobody knows.
std::uint64_t ReceivedBytes(int handle) {
  tcp_info info{};
  socklen_t bytes = sizeof(info);
  if (getsockopt(handle, IPPROTO_TCP, TCP_INFO, &info, &bytes) != 0) return 0;
  return info.tcpi_bytes_received;
}

/// Memory of this process; 0 where nobody knows.
std::uint64_t ResidentBytes() {
  std::ifstream pages("/proc/self/statm");
  std::uint64_t size = 0, resident = 0;
  pages >> size >> resident;
  return resident * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

void GiveBackFreeMemory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace

struct FloodGuard::Connection {
  SocketId socket;
  std::string address;
  std::atomic<std::size_t> calls = 0;  // that are open
  std::atomic<bool> moved = false;     // since the last look: a call or a message came
  std::atomic<bool> cut = false;
  // Bytes that came until its last message, and since; of FloodGuard's thread.
  std::uint64_t explained = 0, odd = 0;
};

FloodGuard::FloodGuard(const Limits& limits, std::function<std::uint64_t()> accounted)
    : limits_(limits),
      accounted_(std::move(accounted)),
      calm_bytes_(static_cast<std::int64_t>(ResidentBytes())),
      thread_([this] { Serve(); }) {}

FloodGuard::~FloodGuard() {
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  change_.notify_one();
  thread_.join();
}

void FloodGuard::Watch(int handle) {
  const auto socket = SocketId::Of(handle);
  std::string address = AddressOf(handle);
  if (!socket || address.empty()) return;
  auto connection = std::make_shared<Connection>();
  connection->socket = *socket;
  connection->address = address;
  {
    const std::lock_guard lock(mutex_);
    connections_[std::move(address)] = std::move(connection);
  }
  change_.notify_one();
}

std::shared_ptr<FloodGuard::Connection> FloodGuard::Find(std::string_view peer) {
  const std::string address = AddressOf(peer);
  const std::lock_guard lock(mutex_);
  const auto found = connections_.find(address);
  return found == connections_.end() ? nullptr : found->second;
}

void FloodGuard::Cut(Connection& connection, std::string_view why) {
  if (Broken("floods") || connection.cut.exchange(true)) return;
  last_cut_ = std::chrono::steady_clock::now();
  trim_ = true;
  line_.Tell(fmt::format("the connection of {} is cut: {}", connection.address, why));
  // A TCP socket without a peer: what it has received goes too, megabytes that would be read after
  // a shutdown(). gRPC, whose handle it is, meets the error and closes it.
  const sockaddr nobody{.sa_family = AF_UNSPEC, .sa_data = {}};
  if (connection.socket.IsOpen()) connect(connection.socket.handle, &nobody, sizeof(nobody));
}

void FloodGuard::Serve() {
  std::vector<std::shared_ptr<Connection>> connections;
  std::unique_lock lock(mutex_);
  while (!end_) {
    if (connections_.empty() && !trim_) {
      change_.wait(lock, [this] { return end_ || !connections_.empty(); });
    } else {
      change_.wait_for(lock, kBetweenLooks, [this] { return end_; });
    }
    connections.clear();
    for (const auto& [address, connection] : connections_) connections.push_back(connection);
    // Two system calls for each of thousands: no call waits for that.
    lock.unlock();
    const auto closed = std::ranges::partition(
        connections, [](const auto& connection) { return connection->socket.IsOpen(); });
    Look({connections.begin(), closed.begin()});
    lock.lock();
    for (const auto& connection : closed) {
      const auto known = connections_.find(connection->address);
      // The next one from that address may be there already.
      if (known != connections_.end() && known->second == connection) connections_.erase(known);
    }
  }
}

/// Looks at what `connections` have sent, and what that has cost.
void FloodGuard::Look(std::span<const std::shared_ptr<Connection>> connections) {
  std::uint64_t sum = 0;
  for (const auto& connection : connections) {
    const std::uint64_t received = ReceivedBytes(connection->socket.handle);
    // What came before a message is no header without an end, nor a call that was reset.
    if (connection->moved.exchange(false)) connection->explained = received;
    connection->odd = received - std::min(received, connection->explained);
    sum += connection->odd;
  }
  const auto memory =
      static_cast<std::int64_t>(ResidentBytes()) - static_cast<std::int64_t>(accounted_());
  if (sum >= kFewBytes) {
    if (memory - calm_bytes_ > static_cast<std::int64_t>(limits_.bytes)) CutFloods(connections);
    return;
  }
  // What is counted may be taken later: the most that there was, and not what a flood has left.
  const auto calm = std::chrono::steady_clock::now() - last_cut_.load();
  if (calm > kAftermath) calm_bytes_ = std::max(calm_bytes_, memory);
  if (calm > kAftermath / 10 && trim_.exchange(false)) GiveBackFreeMemory();
}

/// Cuts those that have sent at least half as much as the one that has sent the most: the others
/// may be clients who wait to be read.
void FloodGuard::CutFloods(std::span<const std::shared_ptr<Connection>> connections) {
  std::uint64_t most = 0;
  for (const auto& connection : connections) {
    if (!connection->cut) most = std::max(most, connection->odd);
  }
  for (const auto& connection : connections) {
    if (connection->odd < most / 2 || connection->odd == 0) continue;
    Cut(*connection,
        fmt::format(
            "memory has grown by more than {} bytes while it has sent {} that are no messages",
            limits_.bytes, connection->odd));
  }
}

FloodGuard::Presence::Presence(FloodGuard& guard, std::string_view peer)
    : guard_(guard), connection_(guard.Find(peer)) {
  const std::size_t calls = ++guard_.calls_;
  if (connection_ == nullptr) return;
  const std::size_t own = ++connection_->calls;
  if (calls <= guard_.limits_.calls || own <= guard_.limits_.own_calls) return;
  guard_.Cut(*connection_, fmt::format("it has {} calls, which it opens and resets faster than "
                                       "they can end; {} may be open",
                                       own, guard_.limits_.own_calls));
}

FloodGuard::Presence::~Presence() {
  --guard_.calls_;
  if (connection_ != nullptr) --connection_->calls;
}

void FloodGuard::Presence::Moved() {
  if (connection_ != nullptr) connection_->moved = true;
}

}  // namespace treelight::server
