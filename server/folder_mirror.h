#ifndef TREELIGHT_SERVER_FOLDER_MIRROR_H_
#define TREELIGHT_SERVER_FOLDER_MIRROR_H_

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/snapshot_folder.h"

namespace treelight::server {

struct State;

/// Keeps the store as the data folder is, which other servers write to too: what they build
/// appears, what they delete goes. Safe to call from several threads at once.
///
/// Every look at the store first asks the folder when it was changed, which is a stat. A change is
/// told by a clock that may stand still for some time; so a list of the folder is trusted only
/// where it was begun so much later that a change after it would have another time.
class FolderMirror {
 public:
  /// Files on their way between store and folder, which no update touches while this lives.
  class Transit {
   public:
    /// `begin` names them, or also takes their maps out of the store: no update comes between.
    Transit(FolderMirror& mirror, const std::function<std::vector<std::string>()>& begin);
    ~Transit();
    Transit(const Transit&) = delete;
    Transit& operator=(const Transit&) = delete;

   private:
    FolderMirror& mirror_;
    std::vector<std::string> files_;
  };

  /// For `state` with a folder; `state` outlives it.
  explicit FolderMirror(State& state) : state_(state) {}

  /// Takes up what a start has read. INTERNAL: the disk fails.
  absl::Status Begin(const std::vector<SnapshotFolder::File>& files);

  /// Whether the store shows the folder as it is. A system call.
  bool UpToDate();

  /// Makes the store show what the folder holds now, or held since this was called. Blocks for the
  /// disk. A folder that cannot be listed is told on stderr, and the store stays.
  void Update();

 private:
  using Clock = std::chrono::steady_clock;

  /// What is known of a file that no map of the store, or one, stands for.
  struct Known {
    FileId id;
    bool left_alone = false;  ///< it cannot be loaded, which was told
  };

  void UpdateSince(Clock::time_point asked);
  absl::Status Compare();  // needs updating_

  State& state_;
  std::mutex updating_;                    // before times_
  std::map<std::string, Known> known_;     // guarded by updating_; by name of the file
  std::multiset<std::string> in_transit_;  // guarded by updating_
  bool told_failure_ = false;              // guarded by updating_

  std::mutex times_;
  std::int64_t changed_ = 0;      // guarded by times_; last change of the folder that was seen
  Clock::time_point first_seen_;  // guarded by times_; when `changed_` was seen first
  Clock::time_point listed_;      // guarded by times_; when the last list was begun
  friend void WithNewestMaps(State& state, std::function<void()> then);
};

/// Calls `then` once the store shows all that the folder held when this was called: at once where
/// nothing has changed, or where there is no folder, else on the thread that looks it up.
void WithNewestMaps(State& state, std::function<void()> then);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_FOLDER_MIRROR_H_
