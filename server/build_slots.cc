#include "server/build_slots.h"

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/refusal.h"

namespace treelight::server {

BuildSlots::Slot::~Slot() {
  if (slots_ == nullptr) return;
  const std::lock_guard lock(slots_->mutex_);
  --slots_->taken_;
}

absl::StatusOr<BuildSlots::Slot> BuildSlots::Take(std::chrono::milliseconds retry_delay) {
  const std::lock_guard lock(mutex_);
  if (taken_ >= count_ && !Broken("build_slots")) {
    return Refuse(Quota::kBuilds,
                  fmt::format("builds: {} are open already, the limit is {} (--build-slots); "
                              "repeat later",
                              taken_, count_),
                  retry_delay);
  }
  ++taken_;
  return Slot(this);
}

std::size_t BuildSlots::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

}  // namespace treelight::server
