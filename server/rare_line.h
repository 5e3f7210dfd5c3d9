#ifndef TREELIGHT_SERVER_RARE_LINE_H_
#define TREELIGHT_SERVER_RARE_LINE_H_

#include <chrono>
#include <mutex>
#include <string>

#include "server/tell.h"

namespace treelight::server {

/// A line on stderr that says what may happen often: once a minute. Safe to call from several
/// threads at once.
class RareLine {
 public:
  /// Writes "treelightd: `text`", unless a line was written less than a minute ago.
  void Tell(const std::string& text) {
    constexpr std::chrono::minutes kAgain{1};
    const auto now = std::chrono::steady_clock::now();
    {
      const std::lock_guard lock(mutex_);
      if (told_ != std::chrono::steady_clock::time_point() && now - told_ < kAgain) return;
      told_ = now;
    }
    server::Tell(text);
  }

 private:
  std::mutex mutex_;
  std::chrono::steady_clock::time_point told_;  // guarded by mutex_; not yet: the epoch
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_RARE_LINE_H_
