#ifndef TREELIGHT_SERVER_BUILD_SLOTS_H_
#define TREELIGHT_SERVER_BUILD_SLOTS_H_

#include <chrono>
#include <cstddef>
#include <mutex>
#include <utility>

#include "absl/status/statusor.h"

namespace treelight::server {

/// How many builds may be open, from their header to their answer. Safe to call from several
/// threads at once.
class BuildSlots {
 public:
  /// One slot; given back when it goes. Must not outlive the slots.
  class Slot {
   public:
    Slot() = default;
    Slot(Slot&& other) noexcept : slots_(std::exchange(other.slots_, nullptr)) {}
    Slot& operator=(Slot&& other) noexcept {
      std::swap(slots_, other.slots_);
      return *this;
    }
    ~Slot();

   private:
    friend class BuildSlots;
    explicit Slot(BuildSlots* slots) : slots_(slots) {}
    BuildSlots* slots_ = nullptr;
  };

  explicit BuildSlots(std::size_t count) : count_(count) {}

  /// RESOURCE_EXHAUSTED with Quota::kBuilds and `retry_delay`: all are taken.
  absl::StatusOr<Slot> Take(std::chrono::milliseconds retry_delay);

  std::size_t taken() const;

 private:
  const std::size_t count_;
  mutable std::mutex mutex_;
  std::size_t taken_ = 0;  // guarded by mutex_
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BUILD_SLOTS_H_
