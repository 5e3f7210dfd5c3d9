#ifndef TREELIGHT_CLIENT_RENDER_IMAGE_PHOTONS_H_
#define TREELIGHT_CLIENT_RENDER_IMAGE_PHOTONS_H_

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// How many image photons TraceImagePhotons gives, and of how many it chooses them.
struct ImagePhotonOptions {
  std::uint64_t count = 100'000;        ///< > 0
  int width = 512, height = 512;        ///< pixels of the camera, > 0
  std::uint32_t samples_per_pixel = 1;  ///< paths through each pixel, > 0
  std::uint32_t max_bounces = 1024;     ///< scattering events of one path, > 0
  std::uint64_t seed = 1;               ///< of all random numbers
  /// Called now and then with the paths done, of width * height * samples_per_pixel, on the calling
  /// thread.
  std::function<void(std::uint64_t paths)> progress{};
};

struct ImagePhotons {
  std::vector<float> positions;  ///< [3 count] scene units
  std::uint64_t generated = 0;   ///< of which these were chosen
  std::uint64_t paths = 0;
  std::uint64_t rays = 0;
};

/// Image photons: places at which paths that come from the camera meet diffuse surfaces (reverse
/// path tracing, as in the experiment of Bulavintsev and Zhdanov 2020).
///
/// Paths begin at random places of every pixel and scatter as those of a path tracer, seen surfaces
/// and later ones alike, until Russian roulette by reflectance, the open or max_bounces ends them;
/// every hit on a kDiffuse or kGlossy surface generates a photon. Of all that are generated `count`
/// are chosen, each subset with the same probability (Vitter 1985, "Random Sampling with a
/// Reservoir", algorithm R), so memory is that of `count` photons. They have no power: where one
/// stands is all.
///
/// The same scene, options and seed give the same photons for any number of threads. Runs on the
/// TBB threads of the caller's arena. INVALID_ARGUMENT: an option out of range.
/// FAILED_PRECONDITION: fewer than `count` were generated.
absl::StatusOr<ImagePhotons> TraceImagePhotons(const Intersector& intersector,
                                               const ImagePhotonOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_IMAGE_PHOTONS_H_
