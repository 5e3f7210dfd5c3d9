#ifndef TREELIGHT_TESTS_FAULTS_DISK_H_
#define TREELIGHT_TESTS_FAULTS_DISK_H_

#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/faults/history.h"

namespace treelight::faults {

/// The folder of the maps, on a small disk of its own where this machine allows that, so that it
/// can be filled; and what happens to files.
class Disk {
 public:
  /// Mounts `bytes` of memory at `path`, seen by this process and those it starts. To be made
  /// before any thread is.
  Disk(std::string path, std::uint64_t bytes);
  ~Disk();

  /// Whether it can be filled.
  bool small() const { return small_; }
  const std::string& path() const { return path_; }

  /// Takes all room but `bytes_left`, and gives it back.
  void Fill(std::uint64_t bytes_left);
  void Free();

  /// Changes one bit of a map's file, makes a stretch of it zeros, or cuts its end off. The times
  /// are the caller's to fill in; none where no file could be opened.
  std::optional<Damage> DamageOne(std::mt19937& random);

  std::vector<std::string> Files() const;

 private:
  const std::string path_;
  bool small_ = false;
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_DISK_H_
