#ifndef TREELIGHT_SERVER_ACTIVE_CALLS_H_
#define TREELIGHT_SERVER_ACTIVE_CALLS_H_

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>

#include "absl/status/status.h"

namespace treelight::server {

/// Counts the calls that are open, and lets no new ones in once the server drains. Safe to call
/// from several threads at once.
class ActiveCalls {
 public:
  /// At most `limit` calls are let in at once.
  explicit ActiveCalls(std::size_t limit) : limit_(limit) {}

  /// Counts a call in; it must Leave(), whatever the answer. UNAVAILABLE: the server drains.
  /// RESOURCE_EXHAUSTED with Quota::kCalls: as many as are allowed are open.
  absl::Status Enter();
  void Leave();

  /// From now on Enter() returns UNAVAILABLE.
  void Close();

  std::size_t open() const;

  /// Waits until no call is open, or `deadline`; returns how many are.
  std::size_t WaitForNone(std::chrono::system_clock::time_point deadline);

 private:
  const std::size_t limit_;
  mutable std::mutex mutex_;
  std::condition_variable none_;  // with mutex_: open_ became 0
  std::size_t open_ = 0;          // guarded by mutex_
  bool closed_ = false;           // guarded by mutex_
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_ACTIVE_CALLS_H_
