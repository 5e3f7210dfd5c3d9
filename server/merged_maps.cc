#include "server/merged_maps.h"

#include <utility>

namespace treelight::server {

ResidentFewer MergedMaps::Find(const FewerPhotons& fewer) const {
  const std::lock_guard lock(mutex_);
  const auto found = merged_.find(fewer);
  return found == merged_.end() ? ResidentFewer() : found->second;
}

void MergedMaps::Keep(const FewerPhotons& fewer, ResidentFewer merged) {
  const std::lock_guard lock(mutex_);
  merged_[fewer] = std::move(merged);
}

std::uint64_t MergedMaps::Drop() {
  std::map<FewerPhotons, ResidentFewer> dropped;  // freed without the lock
  const std::lock_guard lock(mutex_);
  for (auto merged = merged_.begin(); merged != merged_.end();) {
    const auto here = merged++;
    if (here->second.tree.use_count() == 1) dropped.insert(merged_.extract(here));
  }
  std::uint64_t bytes = 0;
  for (const auto& [fewer, merged] : dropped) bytes += merged.tree->gatherer->report().device_bytes;
  return bytes;
}

std::uint64_t MergedMaps::held_bytes() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t bytes = 0;
  for (const auto& [fewer, merged] : merged_) bytes += merged.tree->gatherer->report().device_bytes;
  return bytes;
}

std::uint64_t MergedMaps::idle_bytes() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t bytes = 0;
  for (const auto& [fewer, merged] : merged_) {
    if (merged.tree.use_count() == 1) bytes += merged.tree->gatherer->report().device_bytes;
  }
  return bytes;
}

}  // namespace treelight::server
