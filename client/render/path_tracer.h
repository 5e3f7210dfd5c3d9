#ifndef TREELIGHT_CLIENT_RENDER_PATH_TRACER_H_
#define TREELIGHT_CLIENT_RENDER_PATH_TRACER_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "client/render/image.h"
#include "client/render/progressive_image.h"
#include "client/trace/intersector.h"
#include "client/trace/lights.h"
#include "client/trace/random.h"

namespace treelight::client {

/// Radiance that comes back along a ray.
struct PathSample {
  Rgb radiance;            ///< W / unit^2 / sr
  std::uint32_t rays = 0;  ///< shot for it, shadow rays included
};

/// One path of a path tracer (Kajiya 1986) from `ray`: the light is sampled at every diffuse
/// surface and also hit by chance, the two weighted by the balance heuristic (Veach 1997,
/// section 9.2); light that comes through mirrors and glass alone can only be hit. Russian roulette
/// from the fourth surface on. Unbiased.
PathSample TracePath(const Intersector& intersector, const Lights& lights, const Ray& ray,
                     RandomStream& random);

/// The same where it is known what `ray` meets first, if anything: `hit`.
PathSample TracePath(const Intersector& intersector, const Lights& lights, Ray ray,
                     std::optional<Hit> hit, RandomStream& random);

/// What PathTrace renders, and how finely.
struct PathTraceOptions {
  int width = 512, height = 512;         ///< pixels, > 0
  std::uint32_t samples_per_pixel = 64;  ///< > 1
  std::uint64_t seed = 1;                ///< of all random numbers
  /// Ends before samples_per_pixel once the noise is no more than this, W / unit^2 / sr; 0: never.
  double target_noise = 0;
  /// Called now and then with the samples done, of width * height * samples_per_pixel, on the
  /// calling thread.
  std::function<void(std::uint64_t samples)> progress{};
  PreviewOptions preview{};
};

/// A path-traced picture, and how good it is.
struct PathTracedImage {
  Image image;
  /// Estimated standard error of a channel of a pixel, root mean square over the picture: half the
  /// difference between the means of the even and of the odd samples.
  double noise = 0;
  std::uint32_t samples_per_pixel = 0;  ///< taken
  std::uint64_t rays = 0;               ///< shot, shadow rays included
};

/// What a path tracer cannot see of a scene, for a person: the light that comes from point lights
/// by way of mirrors, glass or panes, which no path from the camera meets and no shadow ray
/// reaches. Nothing: the reference is complete.
std::optional<std::string> MissingFromReference(const Scene& scene);

/// Path-traces the scene of `intersector` as its camera sees it: the reference for every other
/// renderer, but for what MissingFromReference says. The same picture for any number of threads.
/// INVALID_ARGUMENT: an option out of range.
absl::StatusOr<PathTracedImage> PathTrace(const Intersector& intersector,
                                          const PathTraceOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PATH_TRACER_H_
