#ifndef TREELIGHT_SERVER_NAMING_LOCK_H_
#define TREELIGHT_SERVER_NAMING_LOCK_H_

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <chrono>
#include <thread>

#include "absl/status/status.h"
#include "server/file_handle.h"

namespace treelight::server {

/// Keeps other servers from giving names to files, while it lives.
class NamingLock {
 public:
  explicit NamingLock(int folder)
      : folder_(openat(folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {}

  /// UNAVAILABLE: another has it for longer than a disk should take. OK without it, where the file
  /// system locks no folders.
  absl::Status Take() const {
    constexpr std::chrono::milliseconds kPause{5};
    constexpr int kTries = 2000;
    for (int i = 0; i < kTries; ++i) {
      if (flock(folder_.get(), LOCK_EX | LOCK_NB) == 0) return absl::OkStatus();
      if (errno != EWOULDBLOCK && errno != EINTR) return absl::OkStatus();
      std::this_thread::sleep_for(kPause);
    }
    return absl::UnavailableError("another server has locked the data folder for 10 s");
  }

 private:
  const FileHandle folder_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_NAMING_LOCK_H_
