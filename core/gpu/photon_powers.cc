#include "core/gpu/photon_powers.h"

#include <iterator>

namespace treelight {

Buffer<PhotonPower> UploadPowers(const Gpu& gpu, const Photons& photons) {
  const bool has_powers = !photons.powers.empty(), has_directions = !photons.directions.empty();
  const std::size_t count = has_powers || has_directions ? photons.size() : 0;
  Buffer<PhotonPower> packed(gpu.memory(), count);
  const auto powers = MakeBuffer<float>(gpu.memory(), gpu.queue(), photons.powers);
  const auto directions = MakeBuffer<cl_short>(gpu.memory(), gpu.queue(), photons.directions);
  Launch(gpu, gpu.stages, "pack_powers", count, kGroupSize, powers.get(), directions.get(),
         static_cast<cl_uint>(count), static_cast<cl_uint>(has_powers),
         static_cast<cl_uint>(has_directions), packed.get());
  return packed;
}

std::vector<float> PowersOf(const std::vector<PhotonPower>& packed) {
  std::vector<float> powers;
  powers.reserve(3 * packed.size());
  for (const PhotonPower& photon : packed)
    powers.insert(powers.end(), std::begin(photon.power), std::end(photon.power));
  return powers;
}

std::vector<std::int16_t> DirectionsOf(const std::vector<PhotonPower>& packed) {
  std::vector<std::int16_t> directions;
  directions.reserve(2 * packed.size());
  for (const PhotonPower& photon : packed)
    directions.insert(directions.end(), std::begin(photon.direction), std::end(photon.direction));
  return directions;
}

}  // namespace treelight
