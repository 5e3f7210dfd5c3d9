#ifndef TREELIGHT_CLIENT_PROGRESS_H_
#define TREELIGHT_CLIENT_PROGRESS_H_

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>

namespace treelight::client {

/// Shows on stderr how far work has come: a bar that is redrawn on a terminal, elsewhere a plain
/// line at most every two seconds. Ends its line when destroyed. Safe to call from several threads
/// at once.
class Progress {
 public:
  /// `label` says what is done ("upload"), `unit` what is counted ("photons"), `total` how many
  /// there are.
  Progress(std::string label, std::uint64_t total, std::string unit, std::FILE* stream = stderr);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` of `total` are done; never less than before.
  void Update(std::uint64_t done);

  /// Ends the line, so that other output can follow. Once; the destructor does it otherwise.
  void End();

 private:
  void Show(std::uint64_t done);

  const std::string label_, unit_;
  const std::uint64_t total_;
  std::FILE* const stream_;
  const bool terminal_;
  std::mutex mutex_;
  std::chrono::steady_clock::time_point shown_at_;  // guarded by mutex_
  std::uint64_t done_ = 0;                          // guarded by mutex_
  std::uint64_t shown_ = 0;                         // guarded by mutex_; what the last output said
  bool ended_ = false;                              // guarded by mutex_
  bool began_ = false;  // guarded by mutex_; whether there was any output
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_PROGRESS_H_
