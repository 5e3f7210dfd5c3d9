#ifndef TREELIGHT_CORE_CPU_CANCELLATION_H_
#define TREELIGHT_CORE_CPU_CANCELLATION_H_

#include <atomic>

#include "core/gatherer.h"

namespace treelight {

/// Whether a build goes on. Once it has stopped it stays so, whatever the check says later: what
/// was left undone is not built upon. Safe to call from several threads at once, if the check is.
class Cancellation {
 public:
  /// Of a build that nobody cancels.
  Cancellation() = default;
  /// `check` outlives it.
  explicit Cancellation(const CancelCheck& check) : check_(check ? &check : nullptr) {}
  Cancellation(const Cancellation&) = delete;
  Cancellation& operator=(const Cancellation&) = delete;

  /// Asks the check. True: return, the result is of no use.
  bool Ask() const {
    if (check_ == nullptr) return false;
    if (!stopped() && (*check_)()) stopped_.store(true, std::memory_order_relaxed);
    return stopped();
  }

  /// Whether Ask() was true.
  bool stopped() const { return stopped_.load(std::memory_order_relaxed); }

 private:
  const CancelCheck* check_ = nullptr;  // null: never
  mutable std::atomic<bool> stopped_ = false;
};

/// For those whom nobody cancels.
inline const Cancellation kNotCancelled;

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_CANCELLATION_H_
