#include "client/render/branches.h"

#include <algorithm>
#include <utility>

#include "client/scenes/vector.h"
#include "client/trace/dielectric.h"

namespace treelight::client {
namespace {

/// Where a part would have less of its sample a branch no longer splits.
constexpr float kMinSplitShare = 0.02f;
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
      return Split(branch, hit, random, {.direction = split.reflected, .weight = {r, r, r}},
                   {.direction = *split.refracted,
                    .weight = (1 - r) * material.transmittance,
                    .radiance_scale = split.radiance_scale});
    }
  }
  if (material.surface == Surface::kPane) {
    const PaneSplit split =
        SplitAtPane(-Dot(branch.ray.direction, hit.normal), material.ior, material.transmittance);
    return Split(
        branch, hit, random,
        {.direction = Reflect(branch.ray.direction, hit.normal), .weight = split.reflected},
        {.direction = branch.ray.direction, .weight = split.passed, .event = Event::kPassage});
  }
  if (material.surface != Surface::kDiffuse) ScatterOne(branch, hit, random);
}

void Branches::Split(const Branch& branch, const Hit& hit, RandomStream& random,
                     const Way& reflected, const Way& passed) {
  const auto share = [&branch](const Way& way) {
    return MaxChannel(branch.weight * way.weight) / branch.radiance_scale;
  };
  if (std::min(share(reflected), share(passed)) < kMinSplitShare)
    return ScatterOne(branch, hit, random);
  // Interpolated normals may send a direction to the wrong side of its facet: it is absorbed there.
  if (Dot(reflected.direction, hit.normal) > 0) Follow(branch, hit, reflected);
  if (Dot(passed.direction, hit.normal) < 0) Follow(branch, hit, passed);
}

void Branches::ScatterOne(const Branch& branch, const Hit& hit, RandomStream& random) {
  const float u = random.Uniform(), v = random.Uniform();
  const auto scattering =
      SampleScattering(branch.ray, hit, PathFrom::kCamera, u, v, Lobes::kSpecular);
  if (!scattering) return;
  Follow(branch, hit,
         {.direction = scattering->direction,
          .weight = scattering->weight,
          .event = scattering->event,
          .radiance_scale = scattering->radiance_scale,
          .density = scattering->density});
}

void Branches::Follow(const Branch& branch, const Hit& hit, const Way& way) {
  const Rgb weight = way.radiance_scale * (branch.weight * way.weight);
  if (branch.specular_hits + 1 > kMaxSpecularHits || !(MaxChannel(weight) > 0)) return;
  const bool straight_on = way.event == Event::kPassage;
  branches_.push_back({.ray = LeaveSurface(hit, way.direction),
                       .weight = weight,
                       .specular_hits = branch.specular_hits + 1,
                       .density = straight_on ? branch.density : way.density,
                       .travelled = straight_on ? branch.travelled : 0,
                       .radiance_scale = way.radiance_scale * branch.radiance_scale});
}

}  // namespace treelight::client
