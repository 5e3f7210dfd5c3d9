#ifndef TREELIGHT_CORE_GPU_PHOTON_POWERS_H_
#define TREELIGHT_CORE_GPU_PHOTON_POWERS_H_

#include <cstdint>
#include <vector>

#include "core/builder.h"
#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/kernels/types.h"

namespace treelight {

/// Uploads powers and directions, in order of photon index (photon_powers.cl). Empty where there
/// are neither.
Buffer<PhotonPower> UploadPowers(const Gpu& gpu, const Photons& photons);

/// The powers [3n] alone.
std::vector<float> PowersOf(const std::vector<PhotonPower>& packed);

/// The directions [2n] alone.
std::vector<std::int16_t> DirectionsOf(const std::vector<PhotonPower>& packed);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_PHOTON_POWERS_H_
