#include "server/file_watch.h"

#include <sys/stat.h>

#include <array>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <utility>

namespace treelight::server {
namespace {

/// What differs where a file does; zeros where there is none.
using Signature = std::array<std::int64_t, 7>;

std::vector<Signature> Look(const std::vector<std::string>& files) {
  std::vector<Signature> signatures;
  for (const std::string& file : files) {
    struct stat status {};
    Signature signature{};
    if (stat(file.c_str(), &status) == 0) {
      signature = {static_cast<std::int64_t>(status.st_dev),
                   static_cast<std::int64_t>(status.st_ino),
                   status.st_size,
                   status.st_mtim.tv_sec,
                   status.st_mtim.tv_nsec,
                   status.st_ctim.tv_sec,  // of permissions and owners too
                   status.st_ctim.tv_nsec};
    }
    signatures.push_back(signature);
  }
  return signatures;
}

}  // namespace

FileWatch::FileWatch(std::vector<std::string> files, std::chrono::milliseconds interval,
                     std::function<void()> changed)
    : thread_([seen = Look(files), files = std::move(files), interval,
               changed = std::move(changed)](const std::stop_token& stop) mutable {
        std::mutex mutex;  // of the wait alone
        std::condition_variable_any wake;
        while (true) {
          std::unique_lock lock(mutex);
          wake.wait_for(lock, stop, interval, [] { return false; });
          if (stop.stop_requested()) return;
          auto now = Look(files);
          if (now == seen) continue;
          seen = std::move(now);
          changed();
        }
      }) {}

}  // namespace treelight::server
