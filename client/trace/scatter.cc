#include "client/trace/scatter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/scenes/vector.h"
#include "client/trace/sampling.h"

namespace treelight::client {
namespace {

constexpr float kInvPi = std::numbers::inv_pi_v<float>;

/// Probability of the Lambertian part of a kDiffuse or kGlossy surface, and of its lobe; both are 0
/// where all is absorbed.
struct LobeChoice {
  float diffuse = 0, specular = 0;
};

LobeChoice ChooseLobe(const Material& material, Lobes lobes) {
  const float diffuse = lobes == Lobes::kSpecular ? 0 : MaxChannel(material.reflectance);
  const float specular = lobes == Lobes::kDiffuse || material.surface != Surface::kGlossy
                             ? 0
                             : MaxChannel(material.specular);
  const float sum = diffuse + specular;
  if (!(sum > 0)) return {};
  return {diffuse / sum, specular / sum};
}

/// Density (n + 1) / (2 pi) cos^n of a direction at an angle of that cosine to the mirror
/// direction.
float PhongDensity(float exponent, float cosine) {
  return cosine > 0 ? (exponent + 1) * (kInvPi / 2) * std::pow(cosine, exponent) : 0;
}

/// The normal about which paths from `from` leave a wide lobe: |wo.Ns| or |wo.Ng| in the weight.
const Vec3& CosineNormal(const Hit& hit, PathFrom from) {
  return from == PathFrom::kCamera ? hit.shading_normal : hit.normal;
}

/// `direction` may leave the surface as a reflection.
bool LeavesOutside(const Hit& hit, const Vec3& direction) { return Dot(direction, hit.normal) > 0; }

/// Draws from the Lambertian part or the lobe of kDiffuse and kGlossy.
std::optional<Scattering> SampleWide(const Ray& ray, const Hit& hit, PathFrom from, float u,
                                     float v, Lobes lobes) {
  const Material& material = *hit.material;
  const LobeChoice choice = ChooseLobe(material, lobes);
  const Vec3& normal = CosineNormal(hit, from);
  const Vec3 mirrored = Reflect(ray.direction, hit.shading_normal);
  Scattering scattering;
  if (u < choice.diffuse) {
    scattering.event = Event::kDiffuse;
    scattering.direction = CosineDirection(normal, u / choice.diffuse, v);
    scattering.weight = (1 / choice.diffuse) * material.reflectance;
  } else if (choice.specular > 0) {
    // f cos / density = specular (n + 2) / (n + 1) cos.
    const float n = material.exponent;
    scattering.event = Event::kSpecular;
    scattering.direction =
        PhongDirection(mirrored, n, std::min((u - choice.diffuse) / choice.specular, 1.0f), v);
    scattering.weight = ((n + 2) / (n + 1) * Dot(scattering.direction, normal) / choice.specular) *
                        material.specular;
  } else {
    return std::nullopt;
  }
  if (!LeavesOutside(hit, scattering.direction)) return std::nullopt;
  if (scattering.event == Event::kSpecular &&
      !(-Dot(ray.direction, hit.shading_normal) > 0 &&
        Dot(scattering.direction, hit.shading_normal) > 0)) {
    return std::nullopt;
  }
  if (from == PathFrom::kLight) scattering.shading = ArrivalFactor(ray, hit);
  scattering.density =
      choice.diffuse * kInvPi * std::max(0.0f, Dot(scattering.direction, normal)) +
      choice.specular * PhongDensity(material.exponent, Dot(scattering.direction, mirrored));
  return scattering;
}

/// Completes a reflection or refraction at a mirror or a dielectric, of which there is one
/// direction.
std::optional<Scattering> Bend(const Ray& ray, const Hit& hit, PathFrom from, const Vec3& direction,
                               bool reflected, const Rgb& weight) {
  const float cos_shading = Dot(direction, hit.shading_normal);
  const float cos_geometric = Dot(direction, hit.normal);
  const bool on_its_side =
      reflected ? cos_geometric > 0 && cos_shading > 0 : cos_geometric < 0 && cos_shading < 0;
  if (!on_its_side || !(-Dot(ray.direction, hit.shading_normal) > 0)) return std::nullopt;
  float shading = 1;
  if (from == PathFrom::kLight) {
    const float arrival = Dot(ray.direction, hit.shading_normal) / Dot(ray.direction, hit.normal);
    shading = std::min(arrival * cos_geometric / cos_shading, kMaxShading);
  }
  return Scattering{
      .direction = direction, .weight = weight, .shading = shading, .event = Event::kSpecular};
}

std::optional<Scattering> SampleDielectric(const Ray& ray, const Hit& hit, PathFrom from, float u) {
  const DielectricSplit split = SplitAtHit(ray, hit);
  if (u < split.reflectance || !split.refracted)
    return Bend(ray, hit, from, split.reflected, /*reflected=*/true, {1, 1, 1});
  const float scale = from == PathFrom::kCamera ? split.radiance_scale : 1;
  auto scattering =
      Bend(ray, hit, from, *split.refracted, /*reflected=*/false, hit.material->transmittance);
  if (scattering) scattering->radiance_scale = scale;
  return scattering;
}

std::optional<Scattering> SamplePane(const Ray& ray, const Hit& hit, float u) {
  const PaneSplit split =
      SplitAtPane(-Dot(ray.direction, hit.normal), hit.material->ior, hit.material->transmittance);
  const float reflected = MaxChannel(split.reflected), passed = MaxChannel(split.passed);
  const float probability = reflected / (reflected + passed);
  if (u < probability) {
    return Scattering{.direction = Reflect(ray.direction, hit.normal),
                      .weight = (1 / probability) * split.reflected,
                      .event = Event::kSpecular};
  }
  return Scattering{.direction = ray.direction,
                    .weight = (1 / (1 - probability)) * split.passed,
                    .event = Event::kPassage};
}

}  // namespace

std::optional<Scattering> SampleScattering(const Ray& ray, const Hit& hit, PathFrom from, float u,
                                           float v, Lobes lobes) {
  switch (hit.material->surface) {
    case Surface::kDiffuse:
    case Surface::kGlossy:
      return SampleWide(ray, hit, from, u, v, lobes);
    case Surface::kMirror:
    case Surface::kDielectric:
    case Surface::kPane:
      break;
  }
  if (lobes == Lobes::kDiffuse) return std::nullopt;
  if (hit.material->surface == Surface::kDielectric) return SampleDielectric(ray, hit, from, u);
  if (hit.material->surface == Surface::kPane) return SamplePane(ray, hit, u);
  return Bend(ray, hit, from, Reflect(ray.direction, hit.shading_normal), /*reflected=*/true,
              hit.material->reflectance);
}

ScatterValue EvaluateScattering(const Ray& ray, const Hit& hit, const Vec3& direction,
                                Lobes lobes) {
  const Material& material = *hit.material;
  const float cosine = Dot(direction, hit.shading_normal);
  if (!ScattersWidely(material) || !LeavesOutside(hit, direction) || !(cosine > 0)) return {};
  const LobeChoice choice = ChooseLobe(material, lobes);
  ScatterValue value;
  if (choice.diffuse > 0) {
    value.value = (kInvPi * cosine) * material.reflectance;
    value.density = choice.diffuse * kInvPi * cosine;
  }
  if (choice.specular > 0 && -Dot(ray.direction, hit.shading_normal) > 0) {
    // f = specular (n + 2) / (2 pi) cos^n (Lafortune and Willems 1994, equation 5).
    const float n = material.exponent;
    const float density =
        PhongDensity(n, Dot(direction, Reflect(ray.direction, hit.shading_normal)));
    value.value += ((n + 2) / (n + 1) * density * cosine) * material.specular;
    value.density += choice.specular * density;
  }
  return value;
}

float ArrivalFactor(const Ray& ray, const Hit& hit) {
  const float shading = -Dot(ray.direction, hit.shading_normal);
  const float geometric = -Dot(ray.direction, hit.normal);
  if (!(shading > 0)) return 0;
  return shading < kMaxShading * geometric ? shading / geometric : kMaxShading;
}

bool ScattersWidely(const Material& material) {
  return (material.surface == Surface::kDiffuse || material.surface == Surface::kGlossy) &&
         (MaxChannel(material.reflectance) > 0 ||
          (material.surface == Surface::kGlossy && MaxChannel(material.specular) > 0));
}

float BalanceWeight(float density, float other_density) {
  return density > 0 ? density / (density + other_density) : 1;
}

DielectricSplit SplitAtHit(const Ray& ray, const Hit& hit) {
  const float ior = hit.material->ior;
  return SplitAtDielectric(ray.direction, hit.shading_normal, hit.front ? 1 / ior : ior);
}

}  // namespace treelight::client
