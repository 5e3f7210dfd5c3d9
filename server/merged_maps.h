#ifndef TREELIGHT_SERVER_MERGED_MAPS_H_
#define TREELIGHT_SERVER_MERGED_MAPS_H_

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>

#include "core/merged_gather.h"
#include "server/reloadable_map.h"

namespace treelight::server {

/// The maps of fewer photons of one map (core/merged_gather.h) that have been made. Safe to call
/// from several threads at once.
class MergedMaps {
 public:
  /// Null where it has not been made, or was dropped.
  std::shared_ptr<const ResidentTree> Find(const FewerPhotons& fewer) const;

  void Keep(const FewerPhotons& fewer, std::shared_ptr<const ResidentTree> merged);

  /// Lets go of those that nobody gathers from; what they held of their device, bytes.
  std::uint64_t Drop();

  /// What all hold of their device, bytes.
  std::uint64_t held_bytes() const;
  std::uint64_t idle_bytes() const;  ///< what Drop() would give back

 private:
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<FewerPhotons, std::shared_ptr<const ResidentTree>> merged_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_MERGED_MAPS_H_
