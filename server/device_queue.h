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
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "server/work_estimate.h"

namespace treelight::server {

/// What a job is, whose it is and when it must be done, by which it may be refused.
struct DeviceAsk {
  Work work{};
  std::chrono::system_clock::time_point deadline = std::chrono::system_clock::time_point::max();
  const void* call = nullptr;  ///< which jobs share a turn, an address that tells calls apart
  /// Jobs of a few items with the same key and kind of work go together: those that wait when one
  /// of them is next. Empty: alone.
  std::string together{};
  /// Of jobs with a key: does the work of all that go together. Called once, of one of them.
  std::function<void()> launch{};
};

/// Work for the device, one job at a time, on a thread of its own. Safe to call from several
/// threads at once.
///
/// Calls share the device by fair queueing (Demers, Keshav and Shenker 1989, "Analysis and
/// Simulation of a Fair Queueing Algorithm", section 2). Were the device cut into equal shares for
/// all calls with jobs here, each call would progress at the rate dV/dt = 1 / calls; a job that
/// comes at virtual time V then finishes at
///   F = max(V, F of the last job of its call) + time of the job
/// and the job with the smallest F is next, the earlier one where two are equal. So a small job
/// passes the large ones of others, however many calls they come from, and a large one waits at
/// most until each other call has had as much of the device. Jobs of one call keep their order.
/// Nothing waits to be joined: what has come by the time that the device is free goes together, and
/// each has had its share of the time, by its items.
/// We depart from the paper in that the time of a job that waits is estimated from those before,
/// see WorkEstimate, each time that one is chosen.
class DeviceQueue {
 public:
  /// Says whether the work is still wanted: OK, or why not.
  using Alive = std::function<absl::Status()>;

  /// Called exactly once, on the queue's thread. OK: the device is the job's until it returns.
  /// Otherwise the job must not run: the reason that `Alive` gave, RESOURCE_EXHAUSTED where it had
  /// to leave a full queue, or UNAVAILABLE where the queue ends. `queue_us` is the time it waited.
  /// Of a job with a key it only tells that the job goes: DeviceAsk::launch follows the last one.
  using Turn = std::function<void(const absl::Status& turn, double queue_us)>;

  /// At most `depth` jobs wait; the one that runs does not count.
  explicit DeviceQueue(std::size_t depth);

  /// Finishes the job that runs; those that wait get UNAVAILABLE.
  ~DeviceQueue() = default;

  /// Does not block. RESOURCE_EXHAUSTED, and `turn` is not called: with Quota::kQueueDepth, `depth`
  /// jobs wait already; with Quota::kDeadline, see Check. Where `depth` jobs wait and a gather of
  /// another call would be done later than this job, that gather leaves, with Quota::kQueueDepth.
  absl::Status Submit(Alive alive, Turn turn, const DeviceAsk& ask = {});

  /// RESOURCE_EXHAUSTED with Quota::kDeadline: by the times of earlier jobs, those that go first
  /// and the one that runs will take so long that `ask` would not be done by its deadline. Never on
  /// an idle device: one slow job must not shut out all that follow.
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
    const void* call = nullptr;
    std::string together;
    std::function<void()> launch;
    Clock::time_point submitted;
    double arrived_us = 0;  // V when it came
    double cost_us = 0;     // its part of F, of one that runs
    absl::Status status;    // why it must not run
  };
  using Jobs = std::deque<Job>;
  struct Running {
    Work work;
    Clock::time_point begun;
  };
  /// What a call has of the device.
  struct Share {
    std::size_t job_count = 0;  // that wait or run
    double finish_us = 0;       // F of the last job that ran
  };

  void Run(const std::vector<Job>& jobs, const std::stop_token& stop);
  void Serve(const std::stop_token& stop);
  // All of these need mutex_.
  std::vector<Job> TakeNext();
  std::vector<std::size_t> GoingWith(std::size_t next) const;
  void AdvanceVirtualTime();
  void ForgetJob(const void* call);
  std::vector<double> FinishUs(const DeviceAsk* ask = nullptr) const;
  double LastFinishUs(const void* call) const;
  double CostUs(const Work& work) const;
  double BacklogUs() const;
  double RunningUs() const;
  absl::Status CheckTime(const DeviceAsk& ask) const;
  Jobs::iterator GatherToLeaveFor(const DeviceAsk& ask);
  void MakeLeave(Jobs::iterator job);

  const std::size_t depth_;
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;  // with mutex_: jobs_ or left_ is not empty
  // Guarded by mutex_, all of these.
  Jobs jobs_;  // that wait, in the order in which they came
  Jobs left_;  // had to leave, and are not told yet
  std::optional<Running> running_;
  WorkEstimate estimate_;
  std::unordered_map<const void*, Share> shares_;  // by call: those with jobs, or ahead of V
  std::size_t active_calls_ = 0;                   // calls with jobs
  double virtual_us_ = 0;                          // V
  Clock::time_point advanced_;                     // when V was that
  std::jthread worker_;                            // last: it joins before the rest goes
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_DEVICE_QUEUE_H_
