#ifndef TREELIGHT_SERVER_SIGNAL_WATCH_H_
#define TREELIGHT_SERVER_SIGNAL_WATCH_H_

#include <condition_variable>
#include <functional>
#include <mutex>

namespace treelight::server {

/// Takes SIGTERM, SIGINT and SIGHUP on a thread of its own, so that they count for process 1 of a
/// container too, for which the system ignores signals that nobody takes. One of the first two ends
/// the process at once before BeginServing(), while kernels compile say, as does a second one after
/// it. Lives as long as the process; made before any other thread, as those inherit that the
/// signals are blocked.
class SignalWatch {
 public:
  /// `exit_code` is that of a process that ends at once.
  explicit SignalWatch(int exit_code);
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  /// From now on the first SIGTERM or SIGINT ends Wait() instead of the process, and SIGHUP, of no
  /// effect before, calls `hang_up`.
  void BeginServing(std::function<void()> hang_up);

  /// Blocks until the first SIGTERM or SIGINT.
  void Wait();

  /// From now on SIGHUP has no effect; waits for a `hang_up` that runs.
  void EndServing();

 private:
  void Take(int signal);

  const int exit_code_;
  std::mutex mutex_;
  std::condition_variable wake_;   // with mutex_: signalled_ became true
  bool serving_ = false;           // guarded by mutex_; stays
  bool signalled_ = false;         // guarded by mutex_
  std::function<void()> hang_up_;  // guarded by mutex_
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_SIGNAL_WATCH_H_
