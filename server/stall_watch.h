#ifndef TREELIGHT_SERVER_STALL_WATCH_H_
#define TREELIGHT_SERVER_STALL_WATCH_H_

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <unordered_map>
#include <utility>

namespace treelight::server {

/// Ends calls whose client stands still while memory or a build slot is held for it: one that sends
/// no more of an upload, or takes no more of an answer; and those that wait longest, where too many
/// do. Safe to call from several threads at once.
class StallWatch {
 public:
  /// How long of too many each may stand still: those who all move stand so but for a moment.
  static constexpr std::chrono::milliseconds kGrace{20};

  /// `patience`: how long a client may stand still. `most`: calls that may wait at once; `grace`:
  /// how long each of too many may.
  explicit StallWatch(std::chrono::milliseconds patience, std::size_t most = SIZE_MAX,
                      std::chrono::milliseconds grace = kGrace);

  /// From now on the client of `call` is waited for; `end` is called once where that takes longer
  /// than the patience, or where of more than `most` it has waited longest, and for the grace. It
  /// runs on a thread of the watch, which holds nothing meanwhile.
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
  const std::size_t most_;
  const std::chrono::milliseconds grace_;
  std::mutex mutex_;
  std::condition_variable_any
      wake_;  // with mutex_: the watch ends, ending_ changed, or too many wait
  std::unordered_map<const void*, Waiting> waiting_;  // guarded by mutex_
  const void* ending_ = nullptr;  // guarded by mutex_; the call whose `end` runs
  std::jthread thread_;           // last: it joins before the rest goes
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_STALL_WATCH_H_
