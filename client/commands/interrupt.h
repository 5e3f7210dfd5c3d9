#ifndef TREELIGHT_CLIENT_COMMANDS_INTERRUPT_H_
#define TREELIGHT_CLIENT_COMMANDS_INTERRUPT_H_

#include <signal.h>

namespace treelight::client {

/// While it lives, the first SIGINT or SIGTERM is noted, so that work can end in good order; a
/// second one ends the program as it always does. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Whether there was one. Safe to call from several threads at once.
  static bool interrupted();

 private:
  struct sigaction old_int_ {
  }, old_term_{};
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_INTERRUPT_H_
