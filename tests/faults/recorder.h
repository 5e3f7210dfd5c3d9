#ifndef TREELIGHT_TESTS_FAULTS_RECORDER_H_
#define TREELIGHT_TESTS_FAULTS_RECORDER_H_

#include <chrono>
#include <mutex>
#include <utility>

#include "tests/faults/history.h"

namespace treelight::faults {

/// Writes the history down. Safe to call from several threads at once.
class Recorder {
 public:
  Time Now() const {
    return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::steady_clock::now() -
                                                                 began_)
        .count();
  }
  /// A time of the machine's clock.
  Time FromUnixMs(std::int64_t unix_ms) const {
    const auto now = std::chrono::duration_cast<std::chrono::microseconds>(
        std::chrono::system_clock::now().time_since_epoch());
    return Now() + 1000 * unix_ms - now.count();
  }

  void Add(BuildTry build) { Append(history_.builds, std::move(build)); }
  void Add(Delete gone) { Append(history_.deletes, std::move(gone)); }
  void Add(Gather gather) { Append(history_.gathers, std::move(gather)); }
  void Add(List list) { Append(history_.lists, std::move(list)); }
  void Add(Life life) { Append(history_.lives, std::move(life)); }
  void Add(Damage damage) { Append(history_.damages, std::move(damage)); }
  void Add(Quiet quiet) { Append(history_.quiets, quiet); }
  void AddCut(Disturbance cut) { Append(history_.cuts, cut); }
  void AddFullDisk(Disturbance full) { Append(history_.full_disks, full); }
  void Add(Folder folder) { Append(history_.folders, std::move(folder)); }

  /// What was written down; nobody writes meanwhile.
  History& history() { return history_; }

 private:
  template <typename Event>
  void Append(std::vector<Event>& events, Event event) {
    const std::lock_guard lock(mutex_);
    events.push_back(std::move(event));
  }

  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  History history_;  // guarded by mutex_
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_RECORDER_H_
