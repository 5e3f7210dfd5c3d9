#ifndef TREELIGHT_TESTS_STABILITY_CHILD_PROCESS_H_
#define TREELIGHT_TESTS_STABILITY_CHILD_PROCESS_H_

#include <cstdint>
#include <functional>
#include <string>

namespace treelight {

/// What a child process may take.
struct ChildLimits {
  int seconds = 60;                  ///< wall clock
  std::uint64_t bytes = 4ull << 30;  ///< address space
};

/// How a child process ended.
struct ChildEnd {
  enum Kind { kReturned, kThrew, kOutOfMemory, kKilledBySignal, kTimedOut } kind = kReturned;
  int signal = 0;        ///< where kKilledBySignal
  std::string answer{};  ///< what the work returned, or the exception that it threw
};

/// Runs `work` in a child process and waits for it, so that work that crashes or never ends costs
/// nothing but its case. The caller has no other threads. Throws std::system_error where no process
/// can be made.
ChildEnd RunInChild(const ChildLimits& limits, const std::function<std::string()>& work);

/// "crash (SIGSEGV)", "does not end (60 s)", "out of memory (4 GiB)", "exception: WHAT"; empty for
/// kReturned.
std::string Describe(const ChildEnd& end, const ChildLimits& limits);

/// The most memory that this process ever had resident, bytes.
std::uint64_t PeakResidentBytes();

}  // namespace treelight

#endif  // TREELIGHT_TESTS_STABILITY_CHILD_PROCESS_H_
