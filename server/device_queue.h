#ifndef TREELIGHT_SERVER_DEVICE_QUEUE_H_
#define TREELIGHT_SERVER_DEVICE_QUEUE_H_

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "absl/status/status.h"
#include "server/work_estimate.h"

namespace treelight::server {

/// What a job is and when it must be done, by which it may be refused.
struct DeviceAsk {
  Work work{};
  std::chrono::system_clock::time_point deadline = std::chrono::system_clock::time_point::max();
};

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

  /// Does not block. RESOURCE_EXHAUSTED, and `turn` is not called: with Quota::kQueueDepth, `depth`
  /// jobs wait already; with Quota::kDeadline, see Check.
  absl::Status Submit(Alive alive, Turn turn, const DeviceAsk& ask = {});

  /// RESOURCE_EXHAUSTED with Quota::kDeadline: by the times of earlier jobs, those that wait and
  /// the one that runs will take so long that `ask` would not be done by its deadline. Never on an
  /// idle device: one slow job must not shut out all that follow.
  absl::Status Check(const DeviceAsk& ask) const;

  std::size_t waiting() const;

  /// What the jobs here will take, as far as is known.
  std::chrono::microseconds backlog() const;

  /// When to repeat what was refused for something else: after the backlog, within [100 ms, 30 s].
  std::chrono::milliseconds RetryDelay() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Job {
    Alive alive;
    Turn turn;
    Work work;
    Clock::time_point submitted;
  };
  struct Running {
    Work work;
    Clock::time_point begun;
  };

  void Run(Job& job, const std::stop_token& stop);
  void Serve(const std::stop_token& stop);
  double BacklogUs() const;                            // needs mutex_
  absl::Status CheckTime(const DeviceAsk& ask) const;  // needs mutex_

  const std::size_t depth_;
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;  // with mutex_: jobs_ is not empty
  std::deque<Job> jobs_;              // guarded by mutex_
  std::optional<Running> running_;    // guarded by mutex_
  WorkEstimate estimate_;             // guarded by mutex_
  std::jthread worker_;               // last: it joins before the rest goes
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_DEVICE_QUEUE_H_
