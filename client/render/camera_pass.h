#ifndef TREELIGHT_CLIENT_RENDER_CAMERA_PASS_H_
#define TREELIGHT_CLIENT_RENDER_CAMERA_PASS_H_

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/render/camera_rays.h"
#include "client/render/progressive_image.h"
#include "client/trace/intersector.h"
#include "client/trace/lights.h"

namespace treelight::client {

/// How finely TraceCameraBatch samples.
struct CameraPassOptions {
  std::uint32_t samples_per_pixel = 4;  ///< > 0
  std::uint32_t light_strata = 2;       ///< squared: shadow rays at each diffuse hit
  std::uint32_t final_gather_rays = 0;  ///< at each diffuse hit; 0: no final gathering
  float final_gather_min_distance = 0;  ///< scene units: what a gather ray meets nearer is not
                                        ///< looked up there, but one diffuse bounce further
  std::uint64_t seed = 1;               ///< of all random numbers
  /// Draws a quarter of each pixel in which all of its samples lie: of two pictures with the same
  /// one, but other seeds, what differs within the quarters. Nothing: they lie in all of the pixel.
  std::optional<std::uint64_t> quarter_seed{};
};

/// Where photons are to be gathered, and for which samples.
struct GatherPoints {
  std::vector<float> positions;        ///< [3n] scene units
  std::vector<float> normals;          ///< [3n] of the surface, on the viewer's side
  std::vector<std::uint32_t> samples;  ///< [n] which sample, from the first of the batch
  std::vector<Rgb> weights;  ///< [n] radiance added to the sample per W / unit^2 of irradiance

  std::size_t size() const { return samples.size(); }
  void Add(const Hit& hit, std::uint32_t sample, const Rgb& weight);
  void Append(const GatherPoints& more, std::uint32_t first_sample);
};

/// What the camera sees in consecutive samples but for the light that photons bring.
struct CameraBatch {
  std::vector<Rgb> radiance;  ///< [samples] emission seen and direct light, W / unit^2 / sr; with
                              ///< final gathering also direct light at the ends of its rays
  GatherPoints diffuse_hits;  ///< what the camera sees, straight or through mirrors and glass
  GatherPoints final_gather;  ///< where gather rays end: indirect light is looked up there
  GatherPoints gather_caustics;  ///< where gather rays meet caustics: there, and where they are
                                 ///< followed further
  std::uint64_t rays = 0;        ///< shot, shadow rays included
};

/// Shoots the rays of samples [first, first + count) of `order` and follows them through mirrors
/// and glass to the diffuse surfaces behind. Direct light is both sampled and hit by chance, by a
/// ray of the glossy lobe and one of the diffuse lobe, or the gather rays, weighted by the balance
/// heuristic (Veach 1997, section 9.2).
///
/// With final gathering (Jensen 2001, section 9.2) rays go out from each diffuse hit, cosine
/// weighted and stratified over all samples of the pixel, to the surfaces that light it; their
/// radiance is direct light by one shadow ray, and what is gathered there. Left out: light of point
/// lights that panes reflect, which no gather ray meets.
///
/// Runs on the TBB threads of the caller's arena; the same answer for any number of them.
CameraBatch TraceCameraBatch(const Intersector& intersector, const Lights& lights,
                             const CameraRays& camera, const SampleOrder& order,
                             std::uint64_t first, std::size_t count,
                             const CameraPassOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_CAMERA_PASS_H_
