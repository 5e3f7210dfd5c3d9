#ifndef TREELIGHT_SERVER_REQUEST_TURNS_H_
#define TREELIGHT_SERVER_REQUEST_TURNS_H_

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <utility>

#include "server/stall_watch.h"

namespace treelight::server {

/// Lets few requests be on their way at once. gRPC keeps what has come of a message until it is
/// whole, up to the limit of messages, and tells nobody; a call whose turn has not come holds no
/// more than HTTP/2's first window. Of those that wait the turn is that of the last one to come and
/// of the first by turns: newcomers pass a crowd that stands still, and nobody waits for ever. Safe
/// to call from several threads at once.
class RequestTurns {
 public:
  /// Where more than three quarters of the turns are taken, a request that takes longer than this
  /// to arrive is cut off, the oldest first: clients that send nothing hold up nobody for long.
  static constexpr std::chrono::milliseconds kGrace{500};

  /// That a call's request may be on its way, or is here and not counted elsewhere; over when it
  /// goes. Its RequestTurns outlive it.
  class Turn {
   public:
    Turn() = default;
    Turn(Turn&& other) noexcept : turns_(std::exchange(other.turns_, nullptr)) {}
    Turn& operator=(Turn&& other) noexcept {
      std::swap(turns_, other.turns_);
      other.End();
      return *this;
    }
    ~Turn() { End(); }

   private:
    friend class RequestTurns;
    explicit Turn(RequestTurns& turns) : turns_(&turns) {}
    void End() {
      if (turns_ != nullptr) std::exchange(turns_, nullptr)->Next();
    }

    RequestTurns* turns_ = nullptr;
  };

  /// `most` turns at once, at least 1. `patience`: how long a request may take in any case.
  RequestTurns(std::chrono::milliseconds patience, std::size_t most);

  /// `start` runs once, when it is the turn of `call`: at once, or where the turn of another ends.
  /// From then until Arrived() `end` runs where the request takes too long, as StallWatch::Wait has
  /// it.
  void Await(const void* call, std::function<void()> end, std::function<void(Turn)> start);

  /// The request of `call` is here, or the call ends.
  void Arrived(const void* call) { watch_.Arrived(call); }

  std::size_t most() const { return most_; }

 private:
  struct Waiting {
    const void* call;
    std::function<void()> end;
    std::function<void(Turn)> start;
  };

  void Start(Waiting waiting);
  void Next();

  const std::size_t most_;
  StallWatch watch_;
  std::mutex mutex_;
  std::size_t taken_ = 0;        // guarded by mutex_
  std::deque<Waiting> waiting_;  // guarded by mutex_; empty while turns are free
  bool last_is_next_ = true;     // guarded by mutex_
};

/// How many requests may be on their way at once where the server's memory is limited to
/// `memory_limit`: an eighth of it, and eight in any case.
std::size_t AffordableTurns(std::uint64_t memory_limit, std::uint64_t message_bytes);

/// The memory of AffordableTurns, which nothing else may take: whole messages within an eighth of
/// `memory_limit`.
std::uint64_t TurnBytes(std::uint64_t memory_limit, std::uint64_t message_bytes);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_REQUEST_TURNS_H_
