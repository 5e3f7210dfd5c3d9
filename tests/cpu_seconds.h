#ifndef TREELIGHT_TESTS_CPU_SECONDS_H_
#define TREELIGHT_TESTS_CPU_SECONDS_H_

#include <ctime>

namespace treelight {

/// CPU time that all threads of this process have taken, seconds: what does not depend on who else
/// works on the machine.
inline double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace treelight

#endif  // TREELIGHT_TESTS_CPU_SECONDS_H_
