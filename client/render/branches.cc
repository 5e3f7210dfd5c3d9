#include "client/render/branches.h"

#include <algorithm>
#include <utility>

#include "client/scenes/vector.h"
#include "client/trace/dielectric.h"

namespace treelight::client {
namespace {

/// Below this share of its sample a branch no longer splits.
constexpr float kMinSplitWeight = 0.02f;
constexpr std::uint32_t kMaxSpecularHits = 64;

}  // namespace

void Branches::Begin(const Ray& ray, const std::optional<Hit>& first) {
  branches_.clear();
  first_.reset();
  ++rays_;
  if (first)
    first_.emplace(Branch{.ray = ray, .weight = {1, 1, 1}, .travelled = first->distance}, *first);
}

std::optional<std::pair<Branch, Hit>> Branches::Next() {
  if (first_) return std::exchange(first_, std::nullopt);
  while (!branches_.empty()) {
    Branch branch = branches_.back();
    branches_.pop_back();
    ++rays_;
    if (const auto hit = intersector_.Intersect(branch.ray)) {
      branch.travelled += hit->distance;
      return std::pair{branch, *hit};
    }
  }
  return std::nullopt;
}

void Branches::Scatter(const Branch& branch, const Hit& hit, RandomStream& random) {
  const Material& material = *hit.material;
  if (material.surface == Surface::kDielectric) {
    const DielectricSplit split = SplitAtHit(branch.ray, hit);
    if (split.refracted) {
      const float r = split.reflectance;
      return Split(branch, hit, random, split.reflected, {r, r, r}, *split.refracted,
                   ((1 - r) * split.radiance_scale) * material.transmittance, Event::kSpecular);
    }
  }
  if (material.surface == Surface::kPane) {
    const PaneSplit split =
        SplitAtPane(-Dot(branch.ray.direction, hit.normal), material.ior, material.transmittance);
    return Split(branch, hit, random, Reflect(branch.ray.direction, hit.normal), split.reflected,
                 branch.ray.direction, split.passed, Event::kPassage);
  }
  if (material.surface != Surface::kDiffuse) ScatterOne(branch, hit, random);
}

void Branches::Split(const Branch& branch, const Hit& hit, RandomStream& random,
                     const Vec3& mirrored, const Rgb& reflected, const Vec3& onward,
                     const Rgb& passed, Event passing) {
  const Rgb a = branch.weight * reflected, b = branch.weight * passed;
  if (std::min(MaxChannel(a), MaxChannel(b)) < kMinSplitWeight)
    return ScatterOne(branch, hit, random);
  // Interpolated normals may send a direction to the wrong side of its facet: it is absorbed there.
  if (Dot(mirrored, hit.normal) > 0) Follow(branch, hit, mirrored, a, Event::kSpecular, 0);
  if (Dot(onward, hit.normal) < 0) Follow(branch, hit, onward, b, passing, 0);
}

void Branches::ScatterOne(const Branch& branch, const Hit& hit, RandomStream& random) {
  const float u = random.Uniform(), v = random.Uniform();
  const auto scattering =
      SampleScattering(branch.ray, hit, PathFrom::kCamera, u, v, Lobes::kSpecular);
  if (!scattering) return;
  Follow(branch, hit, scattering->direction,
         (scattering->radiance_scale * branch.weight) * scattering->weight, scattering->event,
         scattering->density);
}

void Branches::Follow(const Branch& branch, const Hit& hit, const Vec3& direction,
                      const Rgb& weight, Event event, float density) {
  if (branch.specular_hits + 1 > kMaxSpecularHits || !(MaxChannel(weight) > 0)) return;
  const bool straight_on = event == Event::kPassage;
  branches_.push_back({.ray = LeaveSurface(hit, direction),
                       .weight = weight,
                       .specular_hits = branch.specular_hits + 1,
                       .density = straight_on ? branch.density : density,
                       .travelled = straight_on ? branch.travelled : 0});
}

}  // namespace treelight::client
