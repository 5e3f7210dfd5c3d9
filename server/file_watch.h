#ifndef TREELIGHT_SERVER_FILE_WATCH_H_
#define TREELIGHT_SERVER_FILE_WATCH_H_

#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <vector>

namespace treelight::server {

/// Tells when files or their permissions have changed, by looking at their size, times of change
/// and place on disk again and again: that also sees files that are replaced through a link, as
/// Kubernetes does with secrets.
class FileWatch {
 public:
  /// Looks every `interval` and calls `changed` on a thread of its own after one of `files` has
  /// changed, appeared or gone. What was there when the watch was
  /// made counts as seen.
  FileWatch(std::vector<std::string> files, std::chrono::milliseconds interval,
            std::function<void()> changed);

 private:
  std::jthread thread_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_FILE_WATCH_H_
