#include "client/render/path_tracer.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "client/render/camera_rays.h"
#include "client/scenes/vector.h"
#include "client/trace/scatter.h"
#include "fmt/format.h"
#include "tbb/blocked_range.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

constexpr std::uint32_t kSurfacesBeforeRoulette = 3;
constexpr float kMaxSurvival = 0.98f;  // so that paths between perfect mirrors end too
constexpr std::uint32_t kSamplesPerPass = 16;

/// Sums over the samples of one pixel, in double: thousands of samples are added.
struct PixelSums {
  double even[3] = {}, odd[3] = {};
  std::uint64_t rays = 0;
};

}  // namespace

PathSample TracePath(const Intersector& intersector, const Lights& lights, Ray ray,
                     RandomStream& random) {
  PathSample sample;
  Rgb throughput{1, 1, 1};
  // Density [1 / sr] with which a surface chose the direction of `ray`; 0 after a camera, mirror or
  // glass. Panes let the ray go straight on: `travelled` is how far it came since that choice.
  float density = 0, travelled = 0;
  for (std::uint32_t surface = 1;; ++surface) {
    ++sample.rays;
    const auto hit = intersector.Intersect(ray);
    if (!hit) return sample;
    const Material& material = *hit->material;
    travelled += hit->distance;

    // Light that was hit, weighted against having sampled it.
    if (hit->front && MaxChannel(material.emission) > 0) {
      const float weight = BalanceWeight(density, lights.Density(*hit, ray.direction, travelled));
      sample.radiance += weight * (throughput * material.emission);
    }

    // Light that is sampled, weighted against hitting it.
    if (ScattersWidely(material) && !lights.empty()) {
      ++sample.rays;
      const float u = random.Uniform(), v = random.Uniform();
      if (const auto light = SampleDirectLight(intersector, lights, *hit, u, v)) {
        const ScatterValue scattered = EvaluateScattering(ray, *hit, light->direction);
        const float weight = BalanceWeight(light->density, scattered.density);
        sample.radiance += weight * (throughput * scattered.value * light->irradiance);
      }
    }

    const float u = random.Uniform(), v = random.Uniform();
    const auto scattering = SampleScattering(ray, *hit, PathFrom::kCamera, u, v);
    if (!scattering) return sample;
    throughput = throughput * scattering->weight;
    if (!(MaxChannel(throughput) > 0)) return sample;
    if (surface > kSurfacesBeforeRoulette) {
      const float survival = std::min(MaxChannel(throughput), kMaxSurvival);
      if (!(random.Uniform() < survival)) return sample;
      throughput = (1 / survival) * throughput;
    }
    if (scattering->event != Event::kPassage) density = scattering->density, travelled = 0;
    ray = LeaveSurface(*hit, scattering->direction);
  }
}

absl::StatusOr<PathTracedImage> PathTrace(const Intersector& intersector,
                                          const PathTraceOptions& options) {
  if (options.width <= 0 || options.height <= 0) {
    return absl::InvalidArgumentError(
        fmt::format("a picture of {} x {} pixels", options.width, options.height));
  }
  const std::uint32_t samples = options.samples_per_pixel;
  if (samples < 2) {
    return absl::InvalidArgumentError(fmt::format("{} samples per pixel; at least 2", samples));
  }
  PathTracedImage result{.image = Image(options.width, options.height)};
  const CameraRays camera(intersector.scene().camera, options.width, options.height);
  const Lights lights(intersector.scene());
  const std::size_t pixel_count = result.image.pixels.size();
  std::vector<PixelSums> sums(pixel_count);

  for (std::uint32_t first = 0; first < samples; first += kSamplesPerPass) {
    const std::uint32_t last = std::min(samples, first + kSamplesPerPass);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pixel_count, 64), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        for (std::uint32_t s = first; s < last; ++s) {
          RandomStream random(options.seed, RandomPurpose::kReferencePath,
                              std::uint64_t{i} * samples + s);
          const float u = random.Uniform(), v = random.Uniform();
          const auto [x, y] = JitterInPixel(s, samples, u, v);
          const PathSample path =
              TracePath(intersector, lights,
                        camera.Through(static_cast<float>(i % options.width) + x,
                                       static_cast<float>(i / options.width) + y),
                        random);
          auto& sum = s % 2 == 0 ? sums[i].even : sums[i].odd;
          sum[0] += path.radiance.r, sum[1] += path.radiance.g, sum[2] += path.radiance.b;
          sums[i].rays += path.rays;
        }
      }
    });
    if (options.progress) options.progress(std::uint64_t{pixel_count} * last);
  }

  const double even_count = (samples + 1) / 2, odd_count = samples / 2;
  double squares = 0;
  for (std::size_t i = 0; i < pixel_count; ++i) {
    float* const channels[] = {&result.image.pixels[i].r, &result.image.pixels[i].g,
                               &result.image.pixels[i].b};
    for (int c = 0; c < 3; ++c) {
      *channels[c] = static_cast<float>((sums[i].even[c] + sums[i].odd[c]) / samples);
      const double half_difference =
          (sums[i].even[c] / even_count - sums[i].odd[c] / odd_count) / 2;
      squares += half_difference * half_difference;
    }
    result.rays += sums[i].rays;
  }
  result.noise = std::sqrt(squares / (3.0 * static_cast<double>(pixel_count)));
  return result;
}

}  // namespace treelight::client
