#ifndef TREELIGHT_CORE_GPU_SCAN_H_
#define TREELIGHT_CORE_GPU_SCAN_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// Replaces the first `count` numbers by their exclusive prefix sums, modulo 2^32 (scan.cl). Does
/// not wait.
void ExclusiveScan(const Gpu& gpu, const Buffer<cl_uint>& values, std::size_t count);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_SCAN_H_
