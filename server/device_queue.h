#ifndef TREELIGHT_SERVER_DEVICE_QUEUE_H_
#define TREELIGHT_SERVER_DEVICE_QUEUE_H_

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>

#include "absl/status/status.h"

namespace treelight::server {

/// Work for the device, one job at a time in the order of submission, on a thread of its own. Safe
/// to call from several threads at once.
class DeviceQueue {
 public:
  /// Says whether the work is still wanted: OK, or why not.
  using Alive = std::function<absl::Status()>;

  /// Called exactly once, on the queue's thread. OK: the device is the job's until it returns.
  /// Otherwise the job must not run: the reason that `Alive` gave, or UNAVAILABLE where the queue
  /// ends. `queue_us` is the time it waited.
  using Turn = std::function<void(const absl::Status& turn, double queue_us)>;

  /// At most `depth` jobs wait; the one that runs does not count.
  explicit DeviceQueue(std::size_t depth);

  /// Finishes the job that runs; those that wait get UNAVAILABLE.
  ~DeviceQueue() = default;

  /// Does not block. RESOURCE_EXHAUSTED: `depth` jobs wait already; then `turn` is not called.
  absl::Status Submit(Alive alive, Turn turn);

  std::size_t waiting() const;

 private:
  struct Job {
    Alive alive;
    Turn turn;
    std::chrono::steady_clock::time_point submitted;
  };

  void Work(const std::stop_token& stop);

  const std::size_t depth_;
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;  // with mutex_: jobs_ is not empty
  std::deque<Job> jobs_;              // guarded by mutex_
  std::jthread worker_;               // last: it joins before the rest goes
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_DEVICE_QUEUE_H_
