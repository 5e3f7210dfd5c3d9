#include "client/render/camera_pass.h"

#include <algorithm>
#include <numbers>
#include <optional>

#include "client/trace/random.h"
#include "client/trace/scatter.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

constexpr std::size_t kPixelsPerTask = 64;
/// Below this share of the pixel sample a ray no longer splits at glass.
constexpr float kMinSplitWeight = 0.02f;
/// Mirrors and glass in a row; what goes on between perfect mirrors is left out.
constexpr std::uint32_t kMaxSpecularHits = 64;

/// A ray still to be followed, and the share of its pixel sample that it carries.
struct Branch {
  Ray ray;
  Rgb weight;
  std::uint32_t specular_hits = 0;
};

class CameraTask {
 public:
  CameraTask(const Intersector& intersector, const Lights& lights, const CameraPassOptions& options)
      : intersector_(intersector), lights_(lights), options_(options) {}

  /// Follows one sample, which is `share` of the pixel that was begun last.
  void TraceSample(const Ray& ray, float share, RandomStream& random) {
    branches_.assign(1, {ray, {share, share, share}});
    while (!branches_.empty()) {
      const Branch branch = branches_.back();
      branches_.pop_back();
      ++batch_.rays;
      if (const auto hit = intersector_.Intersect(branch.ray)) Shade(branch, *hit, share, random);
    }
  }

  void BeginPixel() { batch_.radiance.emplace_back(); }
  CameraBatch& batch() { return batch_; }

 private:
  void Shade(const Branch& branch, const Hit& hit, float share, RandomStream& random) {
    const Material& material = *hit.material;
    if (hit.front) batch_.radiance.back() += branch.weight * material.emission;
    switch (material.surface) {
      case Surface::kDiffuse:
        return ShadeDiffuse(branch, hit, random);
      case Surface::kGlossy:
        ShadeDiffuse(branch, hit, random);
        return FollowOne(branch, hit, random);
      case Surface::kMirror:
      case Surface::kPane:
        return FollowOne(branch, hit, random);
      case Surface::kDielectric:
        break;
    }
    const DielectricSplit split = SplitAtHit(branch.ray, hit);
    const Rgb reflected = split.reflectance * branch.weight;
    const Rgb refracted = (1 - split.reflectance) * (branch.weight * material.transmittance);
    if (split.refracted &&
        std::min(MaxChannel(reflected), MaxChannel(refracted)) >= kMinSplitWeight * share) {
      Follow(branch, hit, split.reflected, reflected);
      Follow(branch, hit, *split.refracted, refracted);
    } else {
      FollowOne(branch, hit, random);
    }
  }

  /// Follows one specular event, chosen at random.
  void FollowOne(const Branch& branch, const Hit& hit, RandomStream& random) {
    const float u = random.Uniform(), v = random.Uniform();
    const auto scattering =
        SampleScattering(branch.ray, hit, PathFrom::kCamera, u, v, Lobes::kSpecular);
    if (scattering) Follow(branch, hit, scattering->direction, branch.weight * scattering->weight);
  }

  void Follow(const Branch& branch, const Hit& hit, const Vec3& direction, const Rgb& weight) {
    if (branch.specular_hits + 1 > kMaxSpecularHits || !(MaxChannel(weight) > 0)) return;
    branches_.push_back({LeaveSurface(hit, direction), weight, branch.specular_hits + 1});
  }

  /// Notes where photons are to be gathered, and adds direct light. A lobe meets area lights when
  /// it is followed, but point lights only here.
  void ShadeDiffuse(const Branch& branch, const Hit& hit, RandomStream& random) {
    if (!ScattersWidely(*hit.material)) return;
    const Rgb weight =  // radiance per irradiance
        std::numbers::inv_pi_v<float> * (branch.weight * hit.material->reflectance);
    batch_.positions.insert(batch_.positions.end(),
                            {hit.position.x, hit.position.y, hit.position.z});
    batch_.normals.insert(batch_.normals.end(), {hit.normal.x, hit.normal.y, hit.normal.z});
    batch_.pixels.push_back(static_cast<std::uint32_t>(batch_.radiance.size() - 1));
    batch_.weights.push_back(weight);
    if (lights_.empty()) return;

    // One shadow ray to each cell of a grid over the lights.
    const std::uint32_t strata = options_.light_strata;
    Rgb reflected;
    for (std::uint32_t i = 0; i < strata * strata; ++i) {
      const float u =
          (static_cast<float>(i % strata) + random.Uniform()) / static_cast<float>(strata);
      const float v =
          (static_cast<float>(i / strata) + random.Uniform()) / static_cast<float>(strata);
      const auto light = SampleDirectLight(intersector_, lights_, hit, u, v);
      if (!light) continue;
      const Lobes lobes = light->density > 0 ? Lobes::kDiffuse : Lobes::kAll;
      reflected +=
          EvaluateScattering(branch.ray, hit, light->direction, lobes).value * light->irradiance;
    }
    batch_.rays += strata * strata;
    batch_.radiance.back() +=
        (1 / static_cast<float>(strata * strata)) * (branch.weight * reflected);
  }

  const Intersector& intersector_;
  const Lights& lights_;
  const CameraPassOptions& options_;
  CameraBatch batch_;
  std::vector<Branch> branches_;
};

void Append(CameraBatch& batch, const CameraBatch& more) {
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  const auto first_pixel = static_cast<std::uint32_t>(batch.radiance.size());
  for (const std::uint32_t pixel : more.pixels) batch.pixels.push_back(first_pixel + pixel);
  append(batch.radiance, more.radiance);
  append(batch.positions, more.positions);
  append(batch.normals, more.normals);
  append(batch.weights, more.weights);
  batch.rays += more.rays;
}

}  // namespace

CameraBatch TraceCameraBatch(const Intersector& intersector, const Lights& lights,
                             const CameraRays& camera, int width, std::size_t first,
                             std::size_t count, const CameraPassOptions& options) {
  const std::uint32_t samples = options.samples_per_pixel;
  std::vector<CameraBatch> parts((count + kPixelsPerTask - 1) / kPixelsPerTask);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t part) {
    CameraTask task(intersector, lights, options);
    const std::size_t part_first = first + part * kPixelsPerTask;
    const std::size_t part_last = std::min(part_first + kPixelsPerTask, first + count);
    for (std::size_t pixel = part_first; pixel < part_last; ++pixel) {
      task.BeginPixel();
      for (std::uint32_t s = 0; s < samples; ++s) {
        RandomStream random(options.seed, RandomPurpose::kCameraSample,
                            std::uint64_t{pixel} * samples + s);
        const float u = random.Uniform(), v = random.Uniform();
        const auto [x, y] = JitterInPixel(s, samples, u, v);
        const Ray ray = camera.Through(static_cast<float>(pixel % width) + x,
                                       static_cast<float>(pixel / width) + y);
        task.TraceSample(ray, 1 / static_cast<float>(samples), random);
      }
    }
    parts[part] = std::move(task.batch());
  });
  CameraBatch batch;
  for (const CameraBatch& part : parts) Append(batch, part);
  return batch;
}

}  // namespace treelight::client
