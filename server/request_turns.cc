#include "server/request_turns.h"

#include <algorithm>

#include "server/break_switch.h"

namespace treelight::server {
namespace {

constexpr std::uint64_t kPartOfMemory = 8;
constexpr std::size_t kFewestTurns = 8;

}  // namespace

RequestTurns::RequestTurns(std::chrono::milliseconds patience, std::size_t most)
    : most_(most), watch_(patience, most - most / 4, kGrace) {}

void RequestTurns::Await(const void* call, std::function<void()> end,
                         std::function<void(Turn)> start) {
  Waiting waiting{call, std::move(end), std::move(start)};
  {
    const std::lock_guard lock(mutex_);
    if (taken_ == most_ && !Broken("request_turns")) {
      waiting_.push_back(std::move(waiting));
      return;
    }
    ++taken_;
  }
  Start(std::move(waiting));
}

void RequestTurns::Start(Waiting waiting) {
  watch_.Wait(waiting.call, std::move(waiting.end));
  waiting.start(Turn(*this));
}

/// A turn has ended.
void RequestTurns::Next() {
  Waiting next;
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.empty()) {
      --taken_;
      return;
    }
    if (std::exchange(last_is_next_, !last_is_next_)) {
      next = std::move(waiting_.back());
      waiting_.pop_back();
    } else {
      next = std::move(waiting_.front());
      waiting_.pop_front();
    }
  }
  Start(std::move(next));
}

std::size_t AffordableTurns(std::uint64_t memory_limit, std::uint64_t message_bytes) {
  return std::max<std::size_t>(kFewestTurns, memory_limit / kPartOfMemory / message_bytes);
}

std::uint64_t TurnBytes(std::uint64_t memory_limit, std::uint64_t message_bytes) {
  return memory_limit / kPartOfMemory / message_bytes * message_bytes;
}

}  // namespace treelight::server
