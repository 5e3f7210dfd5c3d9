#ifndef TREELIGHT_CORE_GPU_DEVICES_H_
#define TREELIGHT_CORE_GPU_DEVICES_H_

#include "core/builder.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// Opens the device of OpenCL that `options` names; where they name none, the first one. Throws
/// StatusError as Device::Open, and NOT_FOUND where there is no such device.
Gpu OpenOpenClDevice(const DeviceOptions& options);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_DEVICES_H_
