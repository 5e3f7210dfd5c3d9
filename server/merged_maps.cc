#include "server/merged_maps.h"

#include <utility>

namespace treelight::server {

std::shared_ptr<const ResidentTree> MergedMaps::Find(const FewerPhotons& fewer) const {
  const std::lock_guard lock(mutex_);
  const auto found = merged_.find(fewer);
  return found == merged_.end() ? nullptr : found->second;
}

void MergedMaps::Keep(const FewerPhotons& fewer, std::shared_ptr<const ResidentTree> merged) {
  const std::lock_guard lock(mutex_);
  merged_[fewer] = std::move(merged);
}

std::uint64_t MergedMaps::Drop() {
  std::map<FewerPhotons, std::shared_ptr<const ResidentTree>> dropped;  // freed without the lock
  const std::lock_guard lock(mutex_);
  for (auto merged = merged_.begin(); merged != merged_.end();) {
    const auto here = merged++;
    if (here->second.use_count() == 1) dropped.insert(merged_.extract(here));
  }
  std::uint64_t bytes = 0;
  for (const auto& [fewer, merged] : dropped) bytes += merged->gatherer->report().device_bytes;
  return bytes;
}

std::uint64_t MergedMaps::held_bytes() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t bytes = 0;
  for (const auto& [fewer, merged] : merged_) bytes += merged->gatherer->report().device_bytes;
  return bytes;
}

std::uint64_t MergedMaps::idle_bytes() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t bytes = 0;
  for (const auto& [fewer, merged] : merged_) {
    if (merged.use_count() == 1) bytes += merged->gatherer->report().device_bytes;
  }
  return bytes;
}

}  // namespace treelight::server
