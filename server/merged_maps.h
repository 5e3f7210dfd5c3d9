#ifndef TREELIGHT_SERVER_MERGED_MAPS_H_
#define TREELIGHT_SERVER_MERGED_MAPS_H_

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>

#include "core/merged_gather.h"
#include "server/reloadable_map.h"

namespace treelight::server {

/// A map of fewer photons on the device, and MapOfFewer::photon_power.
struct ResidentFewer {
  std::shared_ptr<const ResidentTree> tree;
  double photon_power = 0;
};

/// The maps of fewer photons of one map (core/merged_gather.h) that have been made. Safe to call
/// from several threads at once.
class MergedMaps {
 public:
  /// Without a tree where it has not been made, or was dropped.
  ResidentFewer Find(const FewerPhotons& fewer) const;

  void Keep(const FewerPhotons& fewer, ResidentFewer merged);

  /// Lets go of those that nobody gathers from; what they held of their device, bytes.
  std::uint64_t Drop();

  /// What all hold of their device, bytes.
  std::uint64_t held_bytes() const;
  std::uint64_t idle_bytes() const;  ///< what Drop() would give back

 private:
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<FewerPhotons, ResidentFewer> merged_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_MERGED_MAPS_H_
