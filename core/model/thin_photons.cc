#include "core/model/thin_photons.h"

#include <cstddef>
#include <vector>

#include "core/model/finite_float.h"
#include "core/model/split_mix.h"

namespace treelight {
namespace {

/// Indices of the photons that stay.
std::vector<std::size_t> Chosen(std::size_t photon_count, std::uint32_t group_size) {
  std::vector<std::size_t> chosen;
  chosen.reserve(photon_count / group_size + 1);
  for (std::size_t first = 0; first < photon_count; first += group_size) {
    const std::size_t photon = first + SplitMix(first / group_size) % group_size;
    if (photon < photon_count) chosen.push_back(photon);
  }
  return chosen;
}

}  // namespace

Photons ThinPhotons(const Photons& photons, std::uint32_t group_size) {
  const std::vector<std::size_t> chosen = Chosen(photons.size(), group_size);
  const double rescale = static_cast<double>(photons.size()) / static_cast<double>(chosen.size());
  Photons kept;
  kept.positions.reserve(3 * chosen.size());
  kept.powers.reserve(3 * chosen.size());
  if (!photons.directions.empty()) kept.directions.reserve(2 * chosen.size());
  for (const std::size_t photon : chosen) {
    for (std::size_t i = 3 * photon; i < 3 * photon + 3; ++i) {
      kept.positions.push_back(photons.positions[i]);
      kept.powers.push_back(FiniteFloat(rescale * photons.powers[i]));
    }
    if (photons.directions.empty()) continue;
    kept.directions.push_back(photons.directions[2 * photon]);
    kept.directions.push_back(photons.directions[2 * photon + 1]);
  }
  return kept;
}

}  // namespace treelight
