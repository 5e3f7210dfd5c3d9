#include "client/commands/interrupt.h"

#include <atomic>

namespace treelight::client {
namespace {

std::atomic<bool> was_interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free);  // set in a signal handler

}  // namespace

InterruptGuard::InterruptGuard() {
  was_interrupted = false;
  struct sigaction note {};
  note.sa_handler = [](int) { was_interrupted = true; };
  note.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigaction(SIGINT, &note, &old_int_);
  sigaction(SIGTERM, &note, &old_term_);
}

InterruptGuard::~InterruptGuard() {
  sigaction(SIGINT, &old_int_, nullptr);
  sigaction(SIGTERM, &old_term_, nullptr);
}

bool InterruptGuard::interrupted() { return was_interrupted; }

}  // namespace treelight::client
