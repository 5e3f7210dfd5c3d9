#include "client/render/camera_pass.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <optional>
#include <span>

#include "client/render/branches.h"
#include "client/scenes/vector.h"
#include "client/trace/dielectric.h"
#include "client/trace/random.h"
#include "client/trace/scatter.h"
#include "client/trace/targets.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

constexpr std::size_t kSamplesPerTask = 4 * kPacketSize;
/// Surfaces that one gather ray is followed over, near and specular ones.
constexpr std::uint32_t kMaxGatherSurfaces = 64;
/// Diffuse surfaces among them: a corner is left after few bounces.
constexpr std::uint32_t kMaxNearBounces = 4;
/// Rays by the diffuse lobe that look for lamps, on average: at a diffuse hit without gather rays,
/// and where a gather ray ends. They are for what lies next to a lamp: few hits do, but the ends of
/// the gather rays of a whole room meet there, and what one of many lamps lights is seldom sampled.
constexpr float kLampRaysAtHit = 0.25f, kLampRaysAtEnd = 1;
/// Panes that such a ray passes.
constexpr int kMaxPanes = 64;

class CameraTask {
 public:
  CameraTask(const Intersector& intersector, const Lights& lights, const CameraPassOptions& options)
      : intersector_(intersector), lights_(lights), options_(options), branches_(intersector) {}

  /// Traces samples [first, last) of `order`, at most kPacketSize; their camera rays are a packet.
  void TracePacket(const CameraRays& camera, const SampleOrder& order, std::uint64_t first,
                   std::uint64_t last) {
    const std::uint32_t samples = options_.samples_per_pixel;
    const std::uint32_t strata = samples * std::max(1u, options_.final_gather_rays);
    std::vector<Ray> rays;
    std::vector<RandomStream> randoms;
    std::vector<std::uint32_t> first_strata;
    for (std::uint64_t i = first; i < last; ++i) {
      const PixelSample place = order.At(i);
      RandomStream& random =
          randoms.emplace_back(options_.seed, RandomPurpose::kCameraSample,
                               std::uint64_t{place.pixel} * samples + place.sample);
      const float u = random.Uniform(), v = random.Uniform();
      const auto [x, y] = InPixel(place, u, v);
      rays.push_back(
          camera.Through(static_cast<float>(place.x) + x, static_cast<float>(place.y) + y));
      // The samples of a pixel share the strata of its gather rays among them, from a place drawn
      // for the pixel, so that each stratum falls to each sample alike.
      RandomStream shift(options_.seed, RandomPurpose::kFinalGather, place.pixel);
      first_strata.push_back(
          static_cast<std::uint32_t>(shift.Uniform() * static_cast<float>(strata)) + place.sample);
    }
    const auto hits = intersector_.IntersectPacket(rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      first_stratum_ = first_strata[i];
      FollowSample(rays[i], hits[i], randoms[i]);
    }
  }

  CameraBatch Take() {
    ShootShadowRays();
    batch_.rays += branches_.rays();
    return std::move(batch_);
  }

 private:
  std::array<float, 2> InPixel(const PixelSample& place, float u, float v) const {
    if (!options_.quarter_seed)
      return JitterInPixel(place.sample, options_.samples_per_pixel, u, v);
    RandomStream random(*options_.quarter_seed, RandomPurpose::kCameraQuarter, place.pixel);
    return JitterInPixel(static_cast<std::uint32_t>(4 * random.Uniform()), 4, u, v);
  }

  /// Light on its way to a surface, unless its shadow ray meets something.
  struct ShadowRay {
    Segment segment;
    std::uint32_t sample;
    Rgb radiance;  // added to the sample, times what the segment lets pass
  };

  /// Follows the camera ray `ray` of the next sample from what it meets on.
  void FollowSample(const Ray& ray, const std::optional<Hit>& first, RandomStream& random) {
    batch_.radiance.emplace_back();
    branches_.Begin(ray, first);
    while (const auto met = branches_.Next()) {
      const auto& [branch, hit] = *met;
      AddEmission(branch, hit);
      if (ScattersWidely(*hit.material)) ShadeWide(branch, hit, random);
      branches_.Scatter(branch, hit, random);
    }
  }

  std::uint32_t sample() const { return static_cast<std::uint32_t>(batch_.radiance.size() - 1); }
  std::uint32_t shadow_rays() const { return options_.light_strata * options_.light_strata; }
  /// Rays by the diffuse lobe that go out from a diffuse hit and may meet lamps.
  float diffuse_rays() const {
    if (!lights_.can_be_met()) return 0;
    return options_.final_gather_rays > 0 ? static_cast<float>(options_.final_gather_rays)
                                          : kLampRaysAtHit;
  }

  /// Light that was hit; where a lobe chose the way there, weighted against having sampled it.
  void AddEmission(const Branch& branch, const Hit& hit) {
    if (!hit.front || !(MaxChannel(hit.material->emission) > 0)) return;
    float weight = 1;
    if (branch.density > 0) {
      const float light_density = lights_.Density(hit, branch.ray.direction, branch.travelled);
      weight = BalanceWeight(branch.density, static_cast<float>(shadow_rays()) * light_density);
    }
    batch_.radiance.back() += weight * (branch.weight * hit.material->emission);
  }

  void ShadeWide(const Branch& branch, const Hit& hit, RandomStream& random) {
    const Rgb reflected = branch.weight * hit.material->reflectance;
    if (MaxChannel(reflected) > 0) {
      batch_.diffuse_hits.Add(hit, sample(), std::numbers::inv_pi_v<float> * reflected);
      for (std::uint32_t i = 0; i < options_.final_gather_rays; ++i)
        FinalGather(branch, hit, i, random);
      if (options_.final_gather_rays == 0) {
        batch_.radiance.back() += branch.weight * LampOnDiffuseRay(branch.ray, hit, diffuse_rays(),
                                                                   shadow_rays(), random);
      }
    }
    if (lights_.empty()) return;

    // One shadow ray to each cell of a grid over the lights.
    const std::uint32_t strata = options_.light_strata, count = shadow_rays();
    for (std::uint32_t i = 0; i < count; ++i) {
      const float u =
          (static_cast<float>(i % strata) + random.Uniform()) / static_cast<float>(strata);
      const float v =
          (static_cast<float>(i / strata) + random.Uniform()) / static_cast<float>(strata);
      AddDirectLight(branch, hit, u, v, static_cast<float>(count));
    }
    batch_.rays += count;
  }

  /// Adds the light of the light point that (u, v) draws, one of `count`. Rays by the diffuse lobe
  /// and by the glossy one meet lamps too: each part has a weight of its own against that.
  void AddDirectLight(const Branch& branch, const Hit& hit, float u, float v, float count) {
    const auto sampled = SampleUnshadowedLight(lights_, hit, u, v);
    if (!sampled) return;
    const DirectLight& light = sampled->light;
    const ScatterValue diffuse =
        EvaluateScattering(branch.ray, hit, light.direction, Lobes::kDiffuse);
    const ScatterValue lobe =
        EvaluateScattering(branch.ray, hit, light.direction, Lobes::kSpecular);
    const float density = count * light.density;
    const Rgb scattered = BalanceWeight(density, diffuse_rays() * diffuse.density) * diffuse.value +
                          BalanceWeight(density, lobe.density) * lobe.value;
    const Rgb radiance = (1 / count) * (branch.weight * scattered * light.irradiance);
    if (!(MaxChannel(radiance) > 0)) return;
    shadow_rays_.push_back({sampled->shadow, sample(), radiance});
    if (shadow_rays_.size() == kPacketSize) ShootShadowRays();
  }

  /// Those of neighbouring samples go to the same lights: they are packets, too.
  void ShootShadowRays() {
    std::array<Segment, kPacketSize> segments;
    for (std::size_t i = 0; i < shadow_rays_.size(); ++i) segments[i] = shadow_rays_[i].segment;
    const auto passed =
        intersector_.TransmittancePacket(std::span(segments).first(shadow_rays_.size()));
    for (std::size_t i = 0; i < shadow_rays_.size(); ++i)
      batch_.radiance[shadow_rays_[i].sample] += passed[i] * shadow_rays_[i].radiance;
    shadow_rays_.clear();
  }

  /// Radiance back along `ray` by a lamp that a ray of the diffuse lobe at `hit` meets, straight or
  /// through panes. That ray is shot with probability `rays`, beside `light_samples` shadow rays:
  /// with those alone there would be rare and very bright samples next to a lamp, as nothing limits
  /// how much a point of it gives; of this ray the radiance of the lamp does.
  Rgb LampOnDiffuseRay(const Ray& ray, const Hit& hit, float rays, std::uint32_t light_samples,
                       RandomStream& random) {
    const float choice = random.Uniform(), u = random.Uniform(), v = random.Uniform();
    if (!(choice < rays)) return {};
    const auto scattering = SampleScattering(ray, hit, PathFrom::kCamera, u, v, Lobes::kDiffuse);
    if (!scattering) return {};
    Rgb weight = (1 / rays) * scattering->weight;
    Hit from = hit;
    float travelled = 0;
    for (int panes = 0; panes < kMaxPanes; ++panes) {
      const Ray onward = LeaveSurface(from, scattering->direction);
      ++batch_.rays;
      const auto met = intersector_.Intersect(onward);
      if (!met) return {};
      travelled += met->distance;
      const Material& material = *met->material;
      if (met->front && MaxChannel(material.emission) > 0) {
        const float light_density = lights_.Density(*met, onward.direction, travelled);
        return BalanceWeight(rays * scattering->density,
                             static_cast<float>(light_samples) * light_density) *
               (weight * material.emission);
      }
      if (material.surface != Surface::kPane) return {};
      weight = weight * SplitAtPane(-Dot(onward.direction, met->normal), material.ior,
                                    material.transmittance)
                            .passed;
      from = *met;
    }
    return {};
  }

  /// Sends gather ray `index` out from a diffuse hit and follows it to where photons are looked up.
  ///
  /// Light on the diffuse hit is L (S|D)* D S* D, so the ray goes through specular surfaces. A lamp
  /// that it meets straight is direct light, weighted against having sampled it. Other lamps are
  /// caustics, or lit what it came by, which have their own estimates, unless panes alone reflected
  /// it there: that light is in the indirect set, and sampled by nothing else here.
  void FinalGather(const Branch& branch, const Hit& from, std::uint32_t index,
                   RandomStream& random) {
    const std::uint32_t rays = options_.final_gather_rays;
    const std::uint32_t strata = rays * options_.samples_per_pixel;
    const std::uint32_t stratum = (first_stratum_ + index * options_.samples_per_pixel) % strata;
    float u = random.Uniform(), v = random.Uniform();
    const auto place = JitterInPixel(stratum, strata, u, v);
    auto scattering =
        SampleScattering(branch.ray, from, PathFrom::kCamera, place[0], place[1], Lobes::kDiffuse);
    Hit hit = from;
    Ray ray;
    Rgb weight = (1 / static_cast<float>(rays)) * branch.weight;
    const float begin_weight = MaxChannel(weight);
    float travelled = 0, radiance_scale = 1;
    float density = scattering ? scattering->density : 0;  // 0: no longer straight from `from`
    std::uint32_t near_bounces = 0;
    bool focussed = false, reflected_by_pane = false;  // since the last diffuse surface
    for (std::uint32_t surface = 0; scattering && surface < kMaxGatherSurfaces; ++surface) {
      radiance_scale *= scattering->radiance_scale;
      weight = (scattering->radiance_scale * scattering->weight) * weight;
      const float survival = std::min(1.0f, MaxChannel(weight) / (radiance_scale * begin_weight));
      if (surface > 0 && !(random.Uniform() < survival)) return;
      if (surface > 0) weight = (1 / survival) * weight;
      ray = LeaveSurface(hit, scattering->direction);
      ++batch_.rays;
      const auto met = intersector_.Intersect(ray);
      if (!met) return;
      hit = *met;
      travelled += hit.distance;
      if (hit.front && density > 0 && MaxChannel(hit.material->emission) > 0) {
        const float light_density = lights_.Density(hit, ray.direction, travelled);
        batch_.radiance.back() += BalanceWeight(static_cast<float>(rays) * density,
                                                static_cast<float>(shadow_rays()) * light_density) *
                                  (weight * hit.material->emission);
      }
      if (hit.front && reflected_by_pane && !focussed)
        batch_.radiance.back() += weight * hit.material->emission;
      Lobes onward = Lobes::kSpecular;
      if (ScattersWidely(*hit.material)) {
        const Rgb reflected = std::numbers::inv_pi_v<float> * (weight * hit.material->reflectance);
        AddDirectAtEnd(ray, hit, weight, random);
        batch_.gather_caustics.Add(hit, sample(), reflected);
        if (travelled < options_.final_gather_min_distance && near_bounces < kMaxNearBounces) {
          ++near_bounces;
          onward = Lobes::kAll;
        } else {
          batch_.final_gather.Add(hit, sample(), reflected);
        }
      }
      u = random.Uniform(), v = random.Uniform();
      scattering = SampleScattering(ray, hit, PathFrom::kCamera, u, v, onward);
      if (!scattering || scattering->event == Event::kPassage) continue;
      density = 0;
      if (scattering->event == Event::kDiffuse) {
        travelled = 0;
        focussed = reflected_by_pane = false;
      } else {
        (MakesCaustics(*hit.material) ? focussed : reflected_by_pane) = true;
      }
    }
  }

  void AddDirectAtEnd(const Ray& ray, const Hit& hit, const Rgb& weight, RandomStream& random) {
    if (lights_.empty()) return;
    ++batch_.rays;
    const float u = random.Uniform(), v = random.Uniform();
    const float lamp_rays = lights_.can_be_met() ? kLampRaysAtEnd : 0;
    batch_.radiance.back() += weight * LampOnDiffuseRay(ray, hit, lamp_rays, 1, random);
    const auto light = SampleDirectLight(intersector_, lights_, hit, u, v);
    if (!light) return;
    const auto scattered = EvaluateScattering(ray, hit, light->direction, Lobes::kDiffuse);
    batch_.radiance.back() += BalanceWeight(light->density, lamp_rays * scattered.density) *
                              (weight * scattered.value * light->irradiance);
  }

  const Intersector& intersector_;
  const Lights& lights_;
  const CameraPassOptions& options_;
  CameraBatch batch_;
  Branches branches_;
  std::vector<ShadowRay> shadow_rays_;  // not shot yet, fewer than kPacketSize
  std::uint32_t first_stratum_ = 0;     // of the gather rays of the sample that is followed
};

template <typename T>
void AppendAll(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

void GatherPoints::Add(const Hit& hit, std::uint32_t sample, const Rgb& weight) {
  if (!(MaxChannel(weight) > 0)) return;
  positions.insert(positions.end(), {hit.position.x, hit.position.y, hit.position.z});
  normals.insert(normals.end(), {hit.normal.x, hit.normal.y, hit.normal.z});
  samples.push_back(sample);
  weights.push_back(weight);
}

void GatherPoints::Append(const GatherPoints& more, std::uint32_t first_sample) {
  AppendAll(positions, more.positions);
  AppendAll(normals, more.normals);
  for (const std::uint32_t sample : more.samples) samples.push_back(first_sample + sample);
  AppendAll(weights, more.weights);
}

CameraBatch TraceCameraBatch(const Intersector& intersector, const Lights& lights,
                             const CameraRays& camera, const SampleOrder& order,
                             std::uint64_t first, std::size_t count,
                             const CameraPassOptions& options) {
  std::vector<CameraBatch> parts((count + kSamplesPerTask - 1) / kSamplesPerTask);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t part) {
    CameraTask task(intersector, lights, options);
    const std::uint64_t part_first = first + part * kSamplesPerTask;
    const std::uint64_t part_last = std::min(part_first + kSamplesPerTask, first + count);
    for (std::uint64_t i = part_first; i < part_last; i += kPacketSize)
      task.TracePacket(camera, order, i, std::min(i + kPacketSize, part_last));
    parts[part] = task.Take();
  });
  CameraBatch batch;
  for (const CameraBatch& part : parts) {
    const auto first_sample = static_cast<std::uint32_t>(batch.radiance.size());
    AppendAll(batch.radiance, part.radiance);
    batch.diffuse_hits.Append(part.diffuse_hits, first_sample);
    batch.final_gather.Append(part.final_gather, first_sample);
    batch.gather_caustics.Append(part.gather_caustics, first_sample);
    batch.rays += part.rays;
  }
  return batch;
}

}  // namespace treelight::client
