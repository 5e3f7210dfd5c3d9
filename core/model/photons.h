#ifndef TREELIGHT_CORE_MODEL_PHOTONS_H_
#define TREELIGHT_CORE_MODEL_PHOTONS_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/model/box.h"

namespace treelight {

/// Largest magnitude of a coordinate, scene units; beyond it squared distances could overflow.
inline constexpr float kMaxCoordinate = 1e18f;

/// Photons as a structure of arrays; a photon's index is its place in the order of upload.
/// `powers` and `directions` are empty or hold every photon.
struct Photons {
  std::vector<float> positions;  ///< [3n] x, y, z, scene units, finite, within kMaxCoordinate
  std::vector<float> powers;     ///< [3n] red, green, blue, W; or empty
  std::vector<std::int16_t>
      directions;  ///< [2n] octahedral unit vector of travel (octahedral.h); or empty

  std::size_t size() const { return positions.size() / 3; }
  Vec3 position(std::size_t i) const {
    return {positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]};
  }
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_PHOTONS_H_
