#ifndef TREELIGHT_CORE_GPU_GPU_FLOORS_H_
#define TREELIGHT_CORE_GPU_GPU_FLOORS_H_

#include <memory>

#include "core/floors.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// Floors of builds on `gpu`, by its profiling events.
std::unique_ptr<FloorMeter> MakeGpuFloorMeter(Gpu gpu);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_GPU_FLOORS_H_
