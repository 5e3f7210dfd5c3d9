#ifndef TREELIGHT_CORE_MEASURED_COSTS_H_
#define TREELIGHT_CORE_MEASURED_COSTS_H_

#include <map>
#include <mutex>

#include "absl/status/statusor.h"

namespace treelight {

/// Costs of a device by what was measured, each measured when it is first asked for. Safe to call
/// from several threads at once, which may then measure more than once.
template <typename Key, typename Costs>
class MeasuredCosts {
 public:
  /// Those of `key`, by `measure`, which returns absl::StatusOr<Costs>, where they are not known.
  template <typename Measure>
  absl::StatusOr<Costs> Find(const Key& key, Measure measure) {
    {
      const std::lock_guard lock(mutex_);
      if (const auto known = costs_.find(key); known != costs_.end()) return known->second;
    }
    // Without the lock, which others need for less long than this takes.
    const absl::StatusOr<Costs> measured = measure();
    if (!measured.ok()) return measured;
    const std::lock_guard lock(mutex_);
    return costs_.emplace(key, *measured).first->second;
  }

  bool contains(const Key& key) const {
    const std::lock_guard lock(mutex_);
    return costs_.contains(key);
  }

 private:
  mutable std::mutex mutex_;    // never held while something is measured
  std::map<Key, Costs> costs_;  // guarded by mutex_
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_MEASURED_COSTS_H_
