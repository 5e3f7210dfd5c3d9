#ifndef TREELIGHT_SERVER_FLOOD_GUARD_H_
#define TREELIGHT_SERVER_FLOOD_GUARD_H_

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <unordered_map>

#include "server/open_connections.h"
#include "server/rare_line.h"

namespace treelight::server {

/// Cuts connections whose memory gRPC 1.51 does not bound, of whoever connects, without a token:
/// it keeps every call that a client opens and resets for as long as more come, about 28 KiB each,
/// and of headers that do not end (CONTINUATION) all that was sent, and more. Connections over TCP
/// alone: a Unix socket is for those who may open its file. Safe to call from several threads.
class FloodGuard {
 public:
  struct Limits {
    /// Calls that have not ended, of all connections. Where there are more, a connection that has
    /// more than `own_calls` of them, which HTTP/2 allows to be open, is cut: it resets calls
    /// faster than they can end.
    std::size_t calls, own_calls;
    /// By how much the memory of the process that is not accounted for may exceed the most that it
    /// had in calm while connections send what becomes no message; then those that have sent the
    /// most of that are cut.
    std::uint64_t bytes;
  };

  /// `accounted`: bytes of memory that are held for calls, which may grow.
  FloodGuard(const Limits& limits, std::function<std::uint64_t()> accounted);
  ~FloodGuard();
  FloodGuard(const FloodGuard&) = delete;
  FloodGuard& operator=(const FloodGuard&) = delete;

  /// Watches a connection, whose handle that is, until it is closed.
  void Watch(int handle);

 private:
  struct Connection;

 public:
  /// That a call of a connection is open; over when it goes. Its FloodGuard outlives it.
  class Presence {
   public:
    /// `peer` as grpc::ServerContext::peer() has it.
    Presence(FloodGuard& guard, std::string_view peer);
    ~Presence();
    Presence(const Presence&) = delete;
    Presence& operator=(const Presence&) = delete;

    /// A message of the call has come.
    void Moved();

   private:
    FloodGuard& guard_;
    const std::shared_ptr<Connection> connection_;  // null: not over TCP
  };

 private:
  std::shared_ptr<Connection> Find(std::string_view peer);
  void Cut(Connection& connection, std::string_view why);
  void Serve();
  void Look(std::span<const std::shared_ptr<Connection>> connections);
  void CutFloods(std::span<const std::shared_ptr<Connection>> connections);

  const Limits limits_;
  const std::function<std::uint64_t()> accounted_;
  std::atomic<std::size_t> calls_ = 0;  // that are open
  std::atomic<bool> trim_ = false;      // a flood has left free memory
  std::atomic<std::chrono::steady_clock::time_point> last_cut_{};
  RareLine line_;
  std::mutex mutex_;
  // By address and port; guarded by mutex_. Closed ones too, until the next look.
  std::unordered_map<std::string, std::shared_ptr<Connection>> connections_;
  std::int64_t calm_bytes_ = 0;     // of thread_: most memory not accounted for, in calm
  bool end_ = false;                // guarded by mutex_
  std::condition_variable change_;  // with mutex_: the first connection, or the end
  std::thread thread_;              // last: uses the rest
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_FLOOD_GUARD_H_
