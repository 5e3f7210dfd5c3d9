#ifndef TREELIGHT_CLIENT_RENDER_BRANCHES_H_
#define TREELIGHT_CLIENT_RENDER_BRANCHES_H_

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "client/trace/intersector.h"
#include "client/trace/random.h"
#include "client/trace/scatter.h"

namespace treelight::client {

/// A ray from the camera still to be followed.
struct Branch {
  Ray ray;
  Rgb weight;                       ///< radiance along it counts so much in its sample
  std::uint32_t specular_hits = 0;  ///< mirrors, glass, panes and lobes behind it
  /// Density [1 / sr] with which the lobe of a glossy surface chose the direction; 0 after a
  /// camera, mirror or glass.
  float density = 0;
  float travelled = 0;  ///< since that choice, through panes, scene units
  /// (1 / index)^2 of the glass that it is in, as a factor of `weight`: radiance is larger there.
  float radiance_scale = 1;
};

/// The tree of rays that one camera sample becomes on mirrors and glass (Whitted 1980). At glass
/// and panes a branch splits in two while both have 2 % of the sample; then one is chosen at random
/// and has the share of both. A lamp that is seen by a reflection within glass, 4 %, is so seen by
/// every sample. What goes on after 64 such surfaces in a row is left out. Not thread-safe.
class Branches {
 public:
  /// `intersector` must outlive it.
  explicit Branches(const Intersector& intersector) : intersector_(intersector) {}

  /// Begins a sample, of weight 1, whose ray from the camera meets `first`, if anything; what was
  /// left of the one before is forgotten.
  void Begin(const Ray& ray, const std::optional<Hit>& first);

  /// Follows the next ray to the surface that it meets. Nothing: no ray is left. Rays that meet
  /// none are skipped. `travelled` of the branch includes this ray.
  std::optional<std::pair<Branch, Hit>> Next();

  /// Goes on with what the surface at `hit` scatters specularly: mirror, glass, pane, and the lobe
  /// of a glossy one.
  void Scatter(const Branch& branch, const Hit& hit, RandomStream& random);

  std::uint64_t rays() const { return rays_; }  ///< shot since construction

 private:
  /// A way in which a surface sends a branch on.
  struct Way {
    Vec3 direction;
    Rgb weight;  ///< of the light, [0, 1]
    Event event = Event::kSpecular;
    float radiance_scale = 1, density = 0;  ///< as Scattering
  };

  void Split(const Branch& branch, const Hit& hit, RandomStream& random, const Way& reflected,
             const Way& passed);
  void ScatterOne(const Branch& branch, const Hit& hit, RandomStream& random);
  void Follow(const Branch& branch, const Hit& hit, const Way& way);

  const Intersector& intersector_;
  std::optional<std::pair<Branch, Hit>> first_;  // until Next has told it
  std::vector<Branch> branches_;
  std::uint64_t rays_ = 0;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_BRANCHES_H_
