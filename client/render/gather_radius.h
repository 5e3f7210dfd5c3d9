#ifndef TREELIGHT_CLIENT_RENDER_GATHER_RADIUS_H_
#define TREELIGHT_CLIENT_RENDER_GATHER_RADIUS_H_

#include <cstddef>
#include <cstdint>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"

namespace treelight::client {

/// The share of the photons whose k nearest lie within the largest radius of an estimate, where
/// nobody gives one. Indirect light is smooth: its radius keeps k photons nearly everywhere.
/// Caustics are dense where they shine: a radius that kept k photons everywhere would blur them
/// over the dark around them.
inline constexpr double kIndirectRadiusQuantile = 0.95;
inline constexpr double kCausticRadiusQuantile = 0.75;

/// Photons whose k nearest are asked for, at most.
inline constexpr std::size_t kRadiusSample = 4096;

/// The radius, scene units, > 0, within which a share of `quantile`, (0, 1], of the photons of a
/// map have their k nearest, themselves included: a length that follows the size of the scene, the
/// count of photons and where they landed. `photons` are those of `map`, at least one; every
/// n / kRadiusSample-th is asked for. `k` is at most their count, > 0. The same for any number of
/// threads. Blocks. The errors of PhotonMapClient.
absl::StatusOr<float> RadiusOfNearest(PhotonMapClient& client, const MapRef& map,
                                      const Photons& photons, std::uint32_t k, double quantile);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_GATHER_RADIUS_H_
