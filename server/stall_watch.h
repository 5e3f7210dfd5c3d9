#ifndef TREELIGHT_SERVER_STALL_WATCH_H_
#define TREELIGHT_SERVER_STALL_WATCH_H_

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <unordered_map>
#include <utility>

namespace treelight::server {

/// Ends calls whose client stands still while memory or a build slot is held for it: one that sends
/// no more of an upload, or takes no more of an answer. Safe to call from several threads at once.
class StallWatch {
 public:
  /// `patience`: how long a client may stand still.
  explicit StallWatch(std::chrono::milliseconds patience);

  /// From now on the client of `call` is waited for; `end` is called once where that takes longer
  /// than the patience, on a thread of the watch, which holds nothing meanwhile.
  void Wait(const void* call, std::function<void()> end);

  /// The client of `call` has moved, or the call ends. `end` does not run once this returns, except
  /// where `end` itself has brought about this call on its own thread.
  void Arrived(const void* call);

  std::chrono::milliseconds patience() const { return patience_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    Clock::time_point since;
    std::function<void()> end;
  };

  void Watch(const std::stop_token& stop);
  std::optional<std::pair<const void*, std::function<void()>>> TakeLate();  // needs mutex_

  const std::chrono::milliseconds patience_;
  std::mutex mutex_;
  std::condition_variable_any wake_;  // with mutex_: the watch ends, or ending_ changed
  std::unordered_map<const void*, Waiting> waiting_;  // guarded by mutex_
  const void* ending_ = nullptr;  // guarded by mutex_; the call whose `end` runs
  std::jthread thread_;           // last: it joins before the rest goes
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_STALL_WATCH_H_
