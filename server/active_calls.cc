#include "server/active_calls.h"

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

/// How long a call is open is not known; most are short.
constexpr std::chrono::milliseconds kRetryDelay{500};

}  // namespace

absl::Status ActiveCalls::Enter() {
  const std::lock_guard lock(mutex_);
  ++open_;
  if (closed_) return absl::UnavailableError("the server is stopping and takes no new calls");
  if (open_ > limit_ && !Broken("max_calls")) {
    return Refuse(Quota::kCalls,
                  fmt::format("{} calls are open already, the limit is {} (--max-calls); repeat "
                              "later, or send more in one call",
                              open_ - 1, limit_),
                  kRetryDelay);
  }
  return absl::OkStatus();
}

void ActiveCalls::Leave() {
  const std::lock_guard lock(mutex_);
  if (--open_ == 0)
    none_.notify_all();  // under the lock: the waiter may destroy this as soon as it is let go
}

void ActiveCalls::Close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
}

std::size_t ActiveCalls::open() const {
  const std::lock_guard lock(mutex_);
  return open_;
}

std::size_t ActiveCalls::WaitForNone(std::chrono::system_clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  const bool last = deadline == std::chrono::system_clock::time_point::max();
  if (Broken("drain") && !last) return open_;
  none_.wait_until(lock, deadline, [this] { return open_ == 0; });
  return open_;
}

}  // namespace treelight::server
