#ifndef TREELIGHT_TESTS_FAULTS_BOARD_H_
#define TREELIGHT_TESTS_FAULTS_BOARD_H_

#include <atomic>
#include <cstdint>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "client/photon_map_client.h"

namespace treelight::faults {

/// A name of the few that all clients use.
std::string NameOf(std::uint32_t number);

/// What clients know of the maps that are there, and of those that are not any more.
class Board {
 public:
  void Built(const client::MapRef& map);
  void Deleted(const client::MapRef& map);
  /// One of those; with version 0 where there is none.
  client::MapRef AnyBuilt(std::mt19937& random) const;
  client::MapRef AnyDeleted(std::mt19937& random) const;
  std::size_t built_count() const;
  std::uint32_t NextSerial() { return serial_++; }

 private:
  mutable std::mutex mutex_;
  std::vector<client::MapRef> built_, deleted_;  // guarded by mutex_
  std::atomic<std::uint32_t> serial_ = 0;
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_BOARD_H_
