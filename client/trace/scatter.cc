#include "client/trace/scatter.h"

#include "client/trace/sampling.h"

namespace treelight::client {

DielectricSplit SplitAtHit(const Ray& ray, const Hit& hit) {
  const float ior = hit.material->ior;
  return SplitAtDielectric(ray.direction, hit.normal, hit.front ? 1 / ior : ior);
}

Vec3 SampleScattering(const Ray& ray, const Hit& hit, float u, float v) {
  switch (hit.material->surface) {
    case Surface::kDiffuse:
    case Surface::kGlossy:
    case Surface::kPane:
      break;
    case Surface::kMirror:
      return Reflect(ray.direction, hit.normal);
    case Surface::kDielectric: {
      const DielectricSplit split = SplitAtHit(ray, hit);
      return u < split.reflectance ? split.reflected : split.refracted.value_or(split.reflected);
    }
  }
  return CosineDirection(hit.normal, u, v);
}

}  // namespace treelight::client
