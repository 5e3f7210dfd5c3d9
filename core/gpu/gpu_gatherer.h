#ifndef TREELIGHT_CORE_GPU_GPU_GATHERER_H_
#define TREELIGHT_CORE_GPU_GPU_GATHERER_H_

#include <memory>

#include "core/gatherer.h"
#include "core/gpu/device_map.h"

namespace treelight {

/// Answers gathers of `map` on its device.
std::unique_ptr<Gatherer> MakeGpuGatherer(DeviceMap map);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_GPU_GATHERER_H_
