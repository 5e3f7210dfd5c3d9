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
#include "client/render/map_gather.h"
#include "client/render/progressive_image.h"
#include "client/trace/intersector.h"
#include "core/gatherer.h"

namespace treelight::client {

/// What RenderPhotonMaps renders, and how finely.
struct PhotonRenderOptions {
  int width = 512, height = 512;  ///< pixels, > 0
  /// > 0; only every so manyth pixel of every so manyth row gets samples.
  int pixel_stride = 1;
  CameraPassOptions camera{};
  /// Radii that suit a scene of about 2 units; for others RadiusOfNearest finds one. That of
  /// caustics is smaller: they have sharp edges.
  EstimateOptions indirect{.k = 100, .radius = 0.1f}, caustic{.k = 60, .radius = 0.05f};
  /// Called now and then with the samples done, of width * height * samples_per_pixel, on the
  /// calling thread.
  std::function<void(std::uint64_t samples)> progress{};
  PreviewOptions preview{};
  /// Whether PhotonRenderedImage::radius_difference is made too, for a quarter more gathers.
  bool probe_radii = false;
  /// Asked now and then, on the calling thread; true ends the work.
  CancelCheck cancelled{};
};

/// Maps that TracedPhotons became; a set without photons has none.
struct PhotonMaps {
  std::optional<MapRef> indirect{}, caustic{};
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
  double seconds = 0;      ///< from the first ray to the last answer
  double camera_s = 0;     ///< of them camera rays were traced; the server gathers meanwhile
  GatherCost indirect{}, caustic{};  ///< without those of the probe
  Image radius_difference;           ///< RadiusProbe::Difference; no pixels unless it was asked for
  double probe_s = 0;                ///< that the server's device was busy with the probe

  /// That sending and taking answers waited for the server, while the camera may have traced.
  double wait_s() const { return indirect.wait_s + caustic.wait_s; }
  /// That the server's device was busy with gathers, transfers included.
  double device_s() const;
  /// That camera and device were at work at once, at least.
  double overlap_s() const;
};

/// Renders by photon mapping (Jensen 2001, chapters 7 to 9): direct light by shadow rays, caustics
/// as densities gathered from the server times reflectance / pi, indirect light likewise, or by
/// final gathering where options.camera says so. While the server answers, the next samples are
/// traced; what is on its way is bounded. The same picture for any number of threads, with or
/// without preview. Blocks. INVALID_ARGUMENT: an option out of range. CANCELLED: options.cancelled
/// said so. Else the errors of PhotonMapClient.
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
