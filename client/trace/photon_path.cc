#include "client/trace/photon_path.h"

#include <algorithm>
#include <optional>

#include "client/trace/random.h"
#include "client/trace/scatter.h"
#include "core/model/octahedral.h"

namespace treelight::client {
namespace {

void Append(Photons& photons, const Vec3& position, const Rgb& power, const Vec3& direction) {
  photons.positions.insert(photons.positions.end(), {position.x, position.y, position.z});
  photons.powers.insert(photons.powers.end(), {power.r, power.g, power.b});
  const auto encoded = EncodeOctahedral(direction);
  photons.directions.insert(photons.directions.end(), encoded.begin(), encoded.end());
}

/// Every entry of an EnergyBalance.
constexpr Power EnergyBalance::*kEntries[] = {
    &EnergyBalance::emitted, &EnergyBalance::absorbed_diffuse, &EnergyBalance::absorbed_elsewhere,
    &EnergyBalance::escaped, &EnergyBalance::shading,          &EnergyBalance::roulette,
    &EnergyBalance::cut,     &EnergyBalance::direct,           &EnergyBalance::indirect,
    &EnergyBalance::caustic};

bool IsWide(Surface surface) { return surface == Surface::kDiffuse || surface == Surface::kGlossy; }

/// What a path has met so far.
class PathClass {
 public:
  /// The set to which a photon belongs that arrives at a diffuse surface now; nothing: direct
  /// light.
  std::optional<PhotonSet> set() const {
    if (diffuse_) return PhotonSet::kIndirect;
    if (caustic_) return PhotonSet::kCaustic;
    if (reflected_by_pane_) return PhotonSet::kIndirect;
    return std::nullopt;
  }

  void Add(Event event, const Material& material) {
    if (event == Event::kDiffuse) diffuse_ = true;
    if (event == Event::kSpecular) (MakesCaustics(material) ? caustic_ : reflected_by_pane_) = true;
  }

 private:
  bool diffuse_ = false, caustic_ = false, reflected_by_pane_ = false;
};

/// Power that a path brings to a surface, and what becomes of it there.
struct Encounter {
  Rgb arriving;
  Rgb leaving;        // before Russian roulette
  float shading = 1;  // factor in `leaving` that is due to shading normals
};

void AddEncounter(const Encounter& encounter, bool wide, EnergyBalance& energy) {
  // arriving = absorbed + shading + leaving; what is absorbed is reckoned after the correction.
  const Rgb corrected = encounter.shading * encounter.arriving;
  Add(energy.shading, encounter.arriving - corrected);
  Add(wide ? energy.absorbed_diffuse : energy.absorbed_elsewhere, corrected - encounter.leaving);
}

/// Decides by `u` whether a path lives on that leaves a surface with `power`, in proportion to
/// `arriving`; sets the power that it goes on with.
bool Survive(const Rgb& arriving, float u, Rgb& power, EnergyBalance& energy) {
  const float probability = std::min(1.0f, MaxChannel(power) / MaxChannel(arriving));
  Add(energy.roulette, power);
  if (!(u < probability)) return false;
  power = (1 / probability) * power;
  Add(energy.roulette, -1 * power);
  return true;
}

/// A photon arrives with `power`: it is counted, and stored where the set is that of `paths`.
void Arrive(const PhotonPaths& paths, const Ray& ray, const Hit& hit, const PathClass& path,
            const Rgb& power, PhotonBatch& batch) {
  const float factor = ArrivalFactor(ray, hit);
  if (!(factor > 0)) return;
  const auto set = path.set();
  Add(!set                           ? batch.energy.direct
      : *set == PhotonSet::kIndirect ? batch.energy.indirect
                                     : batch.energy.caustic,
      factor * power);
  if (set == paths.set) Append(batch.photons, hit.position, factor * power, ray.direction);
}

Emission Emit(const PhotonPaths& paths, RandomStream& random) {
  if (paths.targets != nullptr) return SampleEmissionTowards(*paths.targets, paths.lights, random);
  // Numbers are drawn in statements of their own: the order in which arguments are evaluated is
  // unspecified.
  const double u = random.FineUniform();
  const float v = random.Uniform(), s = random.Uniform(), t = random.Uniform();
  return SampleEmission(paths.lights, u, v, s, t);
}

void FollowPath(const PhotonPaths& paths, RandomStream& random, PhotonBatch& batch) {
  EnergyBalance& energy = batch.energy;
  auto [ray, power] = Emit(paths, random);
  Add(energy.emitted, power);
  PathClass path;
  // A diffuse event would end a path of the caustic set: none is drawn.
  const Lobes lobes = paths.set == PhotonSet::kCaustic ? Lobes::kSpecular : Lobes::kAll;
  for (std::uint32_t bounce = 0; bounce < paths.max_bounces; ++bounce) {
    if (!(MaxChannel(power) > 0)) return;
    ++batch.rays;
    const auto hit = paths.intersector.Intersect(ray);
    if (!hit) return Add(energy.escaped, power);
    const bool wide = IsWide(hit->material->surface);
    if (wide) Arrive(paths, ray, *hit, path, power, batch);

    const float u = random.Uniform(), v = random.Uniform(), survival = random.Uniform();
    const auto scattering = SampleScattering(ray, *hit, PathFrom::kLight, u, v, lobes);
    const Rgb arriving = power;
    if (!scattering) {
      AddEncounter({.arriving = arriving, .leaving = {}}, wide, energy);
      return;
    }
    power = scattering->shading * (scattering->weight * power);
    AddEncounter({.arriving = arriving, .leaving = power, .shading = scattering->shading}, wide,
                 energy);
    path.Add(scattering->event, *hit->material);
    const float scale = bounce == 0 ? paths.max_specular : 1;
    if (!Survive(scale * arriving, survival, power, energy)) return;
    ray = LeaveSurface(*hit, scattering->direction);
  }
  Add(energy.cut, power);
}

}  // namespace

void TracePath(const PhotonPaths& paths, std::uint64_t index, PhotonBatch& batch) {
  RandomStream random(
      paths.seed,
      paths.set == PhotonSet::kIndirect ? RandomPurpose::kPhotonPath : RandomPurpose::kCausticPath,
      index);
  FollowPath(paths, random, batch);
  batch.stored_until.push_back(static_cast<std::uint32_t>(batch.photons.size()));
}

float MaxSpecular(const Scene& scene) {
  float largest = 0;
  for (const Material& material : scene.materials) {
    switch (material.surface) {
      case Surface::kDiffuse:
        break;
      case Surface::kGlossy:  // the weight of the lobe at right angles
        largest = std::max(largest, MaxChannel(material.specular) * (material.exponent + 2) /
                                        (material.exponent + 1));
        break;
      case Surface::kMirror:
        largest = std::max(largest, MaxChannel(material.reflectance));
        break;
      case Surface::kDielectric:
      case Surface::kPane:
        return 1;
    }
  }
  return std::min(largest, 1.0f);
}

void Add(Power& sum, const Rgb& power) { sum[0] += power.r, sum[1] += power.g, sum[2] += power.b; }

void Add(Power& sum, const Power& power) {
  for (int c = 0; c < 3; ++c) sum[c] += power[c];
}

void Add(EnergyBalance& sum, const EnergyBalance& energy) {
  for (const auto entry : kEntries) Add(sum.*entry, energy.*entry);
}

void Scale(Power& power, double factor) {
  for (double& channel : power) channel *= factor;
}

void Scale(EnergyBalance& energy, double factor) {
  for (const auto entry : kEntries) Scale(energy.*entry, factor);
}

void Append(Photons& photons, const Photons& more) {
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(photons.positions, more.positions);
  append(photons.powers, more.powers);
  append(photons.directions, more.directions);
}

}  // namespace treelight::client
