#ifndef TREELIGHT_CORE_GPU_GPU_BUILDER_H_
#define TREELIGHT_CORE_GPU_GPU_BUILDER_H_

#include <memory>

#include "core/builder.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// A builder on an opened device of OpenCL.
std::unique_ptr<Builder> MakeGpuBuilder(Gpu gpu);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_GPU_BUILDER_H_
