#ifndef TREELIGHT_CORE_CPU_CPU_FLOORS_H_
#define TREELIGHT_CORE_CPU_CPU_FLOORS_H_

#include <memory>

#include "core/floors.h"

namespace treelight {

/// Floors of builds on the CPU, by TBB in the arena of the caller.
std::unique_ptr<FloorMeter> MakeCpuFloorMeter();

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_CPU_FLOORS_H_
