#ifndef TREELIGHT_CORE_CPU_CLOCK_H_
#define TREELIGHT_CORE_CPU_CLOCK_H_

#include <chrono>

namespace treelight {

using Clock = std::chrono::steady_clock;

inline double MicrosecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_CLOCK_H_
