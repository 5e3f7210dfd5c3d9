#ifndef TREELIGHT_CORE_GPU_SAMPLE_RADIUS_H_
#define TREELIGHT_CORE_GPU_SAMPLE_RADIUS_H_

#include <cstdint>
#include <vector>

#include "core/gpu/hierarchy.h"

namespace treelight {

/// SampleGatherRadius of core/cpu/gather_radius.h by gathers of `tree`, any tree over the photons
/// [3n], at least one: the same bits. Waits.
float SampleGatherRadius(const Gpu& gpu, const DeviceTree& tree,
                         const std::vector<float>& positions, std::uint32_t seed);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_SAMPLE_RADIUS_H_
