#ifndef TREELIGHT_CLIENT_RENDER_PHOTON_RENDERER_H_
#define TREELIGHT_CLIENT_RENDER_PHOTON_RENDERER_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "client/render/camera_pass.h"
#include "client/render/image.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// Density estimate from one map: the k nearest photons within a radius, Epanechnikov kernel.
struct EstimateOptions {
  std::uint32_t k = 0;  ///< 0: all within the radius
  float radius = 0;     ///< scene units, > 0, finite
};

/// What RenderPhotonMaps renders, and how finely.
struct PhotonRenderOptions {
  int width = 512, height = 512;  ///< pixels, > 0
  CameraPassOptions camera{};
  EstimateOptions indirect{.k = 100, .radius = 0.1f};
  EstimateOptions caustic{.k = 60, .radius = 0.05f};  ///< smaller: caustics have sharp edges
  /// Called after each batch with the pixels done, on the calling thread.
  std::function<void(std::uint64_t pixels)> progress{};
};

/// Maps that TracedPhotons became; a set without photons has none.
struct PhotonMaps {
  std::optional<MapRef> indirect{}, caustic{};
};

/// One query in so many is in GatherCost::sample.
inline constexpr std::size_t kSampleStride = 64;

/// What gathers from one map cost.
struct GatherCost {
  std::uint64_t queries = 0;
  double kernel_us = 0;         ///< on the server's device
  std::vector<float> sample{};  ///< [3n] positions of every kSampleStride-th query
};

/// What a gather does in the tree of a map, mean over some queries.
struct TraversalCost {
  double nodes_per_query = 0;  ///< inner nodes + leaves
  double tests_per_query = 0;  ///< photons compared
};

/// A picture, and what it cost.
struct PhotonRenderedImage {
  Image image;
  std::uint64_t rays = 0;  ///< camera and shadow rays
  double camera_s = 0;     ///< spent tracing them; the server gathers meanwhile
  double wait_s = 0;       ///< spent waiting for the server
  GatherCost indirect{}, caustic{};
};

/// Renders by photon mapping (Jensen 2001, chapters 7 to 9; indirect light straight from the map,
/// without final gathering): direct light by shadow rays, indirect light and caustics as densities
/// gathered from the server times reflectance / pi. While the server answers one batch of pixels
/// the next is traced. Blocks. INVALID_ARGUMENT: an option out of range. Else the errors of
/// PhotonMapClient.
absl::StatusOr<PhotonRenderedImage> RenderPhotonMaps(const Intersector& intersector,
                                                     PhotonMapClient& client,
                                                     const PhotonMaps& maps,
                                                     const PhotonRenderOptions& options);

/// Gathers at the positions `sample` [3n], n > 0, once more for what that does in the tree of
/// `map`. Blocks. The errors of PhotonMapClient.
absl::StatusOr<TraversalCost> GatherSample(PhotonMapClient& client, const MapRef& map,
                                           const EstimateOptions& estimate,
                                           const std::vector<float>& sample);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PHOTON_RENDERER_H_
