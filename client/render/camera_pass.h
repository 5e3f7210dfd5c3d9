#ifndef TREELIGHT_CLIENT_RENDER_CAMERA_PASS_H_
#define TREELIGHT_CLIENT_RENDER_CAMERA_PASS_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "client/render/camera_rays.h"
#include "client/trace/intersector.h"
#include "client/trace/lights.h"

namespace treelight::client {

/// How finely TraceCameraBatch samples.
struct CameraPassOptions {
  std::uint32_t samples_per_pixel = 4;  ///< > 0
  std::uint32_t light_strata = 2;       ///< squared: shadow rays at each diffuse hit
  std::uint64_t seed = 1;               ///< of all random numbers
};

/// What the camera sees in consecutive pixels but for the light that photons bring.
struct CameraBatch {
  std::vector<Rgb> radiance;          ///< [pixels] emission seen and direct light, W / unit^2 / sr
  std::vector<float> positions;       ///< [3n] diffuse hits, where photons are to be gathered
  std::vector<float> normals;         ///< [3n] of the surface, on the viewer's side
  std::vector<std::uint32_t> pixels;  ///< [n] which pixel, from the first of the batch
  std::vector<Rgb> weights;  ///< [n] radiance added to the pixel per W / unit^2 of irradiance
  std::uint64_t rays = 0;    ///< shot, shadow rays included

  /// Diffuse hits.
  std::size_t size() const { return pixels.size(); }
};

/// Shoots the rays of pixels [first, first + count), counted row by row, and follows them through
/// mirrors and glass to the diffuse surfaces behind (Whitted 1980). At glass a ray splits in two
/// while both matter, then one is chosen at random. Runs on the TBB threads of the caller's arena;
/// the same answer for any number of them.
CameraBatch TraceCameraBatch(const Intersector& intersector, const Lights& lights,
                             const CameraRays& camera, int width, std::size_t first,
                             std::size_t count, const CameraPassOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_CAMERA_PASS_H_
