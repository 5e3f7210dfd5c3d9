#include "client/render/path_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>
#include <vector>

#include "client/render/camera_rays.h"
#include "client/scenes/vector.h"
#include "client/trace/scatter.h"
#include "fmt/format.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

constexpr std::uint32_t kSurfacesBeforeRoulette = 3;
constexpr float kMaxSurvival = 0.98f;  // so that paths between perfect mirrors end too
constexpr std::uint32_t kSamplesPerPass = 16;
constexpr std::size_t kPixelsPerTask = 64;

/// Sums over the samples of one pixel, in double: thousands of samples are added.
struct PixelSums {
  double even[3] = {}, odd[3] = {};
  std::uint64_t rays = 0;
};

Image MeanImage(const std::vector<PixelSums>& sums, std::uint32_t samples,
                const PathTraceOptions& options) {
  Image image(options.width, options.height);
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const auto mean = [&](int c) {
      return static_cast<float>((sums[i].even[c] + sums[i].odd[c]) / samples);
    };
    image.pixels[i] = {mean(0), mean(1), mean(2)};
  }
  return image;
}

class SampleTracer {
 public:
  SampleTracer(const Intersector& intersector, const PathTraceOptions& options)
      : intersector_(intersector),
        options_(options),
        camera_(intersector.scene().camera, options.width, options.height),
        lights_(intersector.scene()) {}

  /// Adds samples [first, last) of the pixels from `first_pixel` on to their sums.
  void Trace(std::size_t first_pixel, std::span<PixelSums> sums, std::uint32_t first,
             std::uint32_t last) const {
    const std::size_t count = sums.size() * (last - first);
    for (std::size_t done = 0; done < count; done += kPacketSize) {
      // Samples, pixel by pixel: their camera rays are a packet.
      std::vector<Ray> rays;
      std::vector<RandomStream> randoms;
      for (std::size_t i = done; i < std::min(done + kPacketSize, count); ++i) {
        const std::size_t pixel = first_pixel + i / (last - first);
        const auto sample = first + static_cast<std::uint32_t>(i % (last - first));
        RandomStream& random =
            randoms.emplace_back(options_.seed, RandomPurpose::kReferencePath,
                                 std::uint64_t{pixel} * options_.samples_per_pixel + sample);
        const float u = random.Uniform(), v = random.Uniform();
        const auto [x, y] = Place(sample, u, v);
        rays.push_back(camera_.Through(static_cast<float>(pixel % options_.width) + x,
                                       static_cast<float>(pixel / options_.width) + y));
      }
      const auto hits = intersector_.IntersectPacket(rays);
      for (std::size_t k = 0; k < rays.size(); ++k) {
        PixelSums& pixel = sums[(done + k) / (last - first)];
        const auto sample = first + static_cast<std::uint32_t>((done + k) % (last - first));
        const PathSample path = TracePath(intersector_, lights_, rays[k], hits[k], randoms[k]);
        auto& sum = sample % 2 == 0 ? pixel.even : pixel.odd;
        sum[0] += path.radiance.r, sum[1] += path.radiance.g, sum[2] += path.radiance.b;
        pixel.rays += path.rays;
      }
    }
  }

 private:
  std::array<float, 2> Place(std::uint32_t sample, float u, float v) const {
    if (!(options_.target_noise > 0))
      return JitterInPixel(sample, options_.samples_per_pixel, u, v);
    // Where the end is not known, each pass covers the pixel evenly, and two passes cover it evenly
    // with even and with odd samples, which tell the noise.
    return JitterInPixel((sample + sample / kSamplesPerPass) % kSamplesPerPass, kSamplesPerPass, u,
                         v);
  }

  const Intersector& intersector_;
  const PathTraceOptions& options_;
  const CameraRays camera_;
  const Lights lights_;
};

/// PathTracedImage::noise after `samples` > 1.
double EstimateNoise(const std::vector<PixelSums>& sums, std::uint32_t samples) {
  const double even_count = (samples + 1) / 2, odd_count = samples / 2;
  double squares = 0;
  for (const PixelSums& pixel : sums) {
    for (int c = 0; c < 3; ++c) {
      const double half_difference = (pixel.even[c] / even_count - pixel.odd[c] / odd_count) / 2;
      squares += half_difference * half_difference;
    }
  }
  return std::sqrt(squares / (3.0 * static_cast<double>(sums.size())));
}

}  // namespace

PathSample TracePath(const Intersector& intersector, const Lights& lights, const Ray& ray,
                     RandomStream& random) {
  return TracePath(intersector, lights, ray, intersector.Intersect(ray), random);
}

PathSample TracePath(const Intersector& intersector, const Lights& lights, Ray ray,
                     std::optional<Hit> hit, RandomStream& random) {
  PathSample sample{.radiance = {}, .rays = 1};
  Rgb throughput{1, 1, 1};
  // Density [1 / sr] with which a surface chose the direction of `ray`; 0 after a camera, mirror or
  // glass. Panes let the ray go straight on: `travelled` is how far it came since that choice.
  float density = 0, travelled = 0;
  float radiance_scale = 1;  // Scattering::radiance_scale of all surfaces, beside `throughput`
  for (std::uint32_t surface = 1;; ++surface) {
    if (!hit) return sample;
    const Material& material = *hit->material;
    travelled += hit->distance;

    // Light that was hit, weighted against having sampled it.
    if (hit->front && MaxChannel(material.emission) > 0) {
      const float weight = BalanceWeight(density, lights.Density(*hit, ray.direction, travelled));
      sample.radiance += (radiance_scale * weight) * (throughput * material.emission);
    }

    // Light that is sampled, weighted against hitting it.
    if (ScattersWidely(material) && !lights.empty()) {
      ++sample.rays;
      const float u = random.Uniform(), v = random.Uniform();
      if (const auto light = SampleDirectLight(intersector, lights, *hit, u, v)) {
        const ScatterValue scattered = EvaluateScattering(ray, *hit, light->direction);
        const float weight = BalanceWeight(light->density, scattered.density);
        sample.radiance +=
            (radiance_scale * weight) * (throughput * scattered.value * light->irradiance);
      }
    }

    const float u = random.Uniform(), v = random.Uniform();
    const auto scattering = SampleScattering(ray, *hit, PathFrom::kCamera, u, v);
    if (!scattering) return sample;
    throughput = throughput * scattering->weight;
    radiance_scale *= scattering->radiance_scale;
    if (!(MaxChannel(throughput) > 0)) return sample;
    if (surface > kSurfacesBeforeRoulette) {
      const float survival = std::min(MaxChannel(throughput), kMaxSurvival);
      if (!(random.Uniform() < survival)) return sample;
      throughput = (1 / survival) * throughput;
    }
    if (scattering->event != Event::kPassage) density = scattering->density, travelled = 0;
    ray = LeaveSurface(*hit, scattering->direction);
    ++sample.rays;
    hit = intersector.Intersect(ray);
  }
}

std::optional<std::string> MissingFromReference(const Scene& scene) {
  if (scene.point_lights.empty()) return std::nullopt;
  const auto is_specular = [&scene](std::uint32_t material) {
    const Surface surface = scene.materials[material].surface;
    return surface == Surface::kMirror || surface == Surface::kDielectric ||
           surface == Surface::kPane;
  };
  std::set<std::string> names;
  for (const std::uint32_t material : scene.mesh.materials)
    if (is_specular(material)) names.insert(scene.materials[material].name);
  for (const Sphere& sphere : scene.spheres)
    if (is_specular(sphere.material)) names.insert(scene.materials[sphere.material].name);
  if (names.empty()) return std::nullopt;
  return fmt::format("the light of {} by way of {}",
                     scene.point_lights.size() == 1
                         ? std::string("the point light")
                         : fmt::format("{} point lights", scene.point_lights.size()),
                     fmt::join(names, ", "));
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
  const SampleTracer tracer(intersector, options);
  std::vector<PixelSums> sums(std::size_t(options.width) * std::size_t(options.height));
  PreviewClock preview(options.preview);

  PathTracedImage result;
  for (std::uint32_t first = 0; first < samples; first = result.samples_per_pixel) {
    // Short passes at the beginning, for the preview.
    const std::uint32_t pass =
        first < kSamplesPerPass ? std::max(1u, first) : kSamplesPerPass - first % kSamplesPerPass;
    const std::uint32_t last = std::min(samples, first + pass);
    const std::size_t tasks = (sums.size() + kPixelsPerTask - 1) / kPixelsPerTask;
    tbb::parallel_for(std::size_t{0}, tasks, [&](std::size_t task) {
      const std::size_t pixel = task * kPixelsPerTask;
      const std::size_t count = std::min(kPixelsPerTask, sums.size() - pixel);
      tracer.Trace(pixel, std::span(sums).subspan(pixel, count), first, last);
    });
    result.samples_per_pixel = last;
    if (options.progress) options.progress(std::uint64_t{sums.size()} * last);
    preview.Update([&] { return MeanImage(sums, last, options); });
    if (options.target_noise > 0 && last % kSamplesPerPass == 0 &&
        EstimateNoise(sums, last) <= options.target_noise) {
      break;
    }
  }
  result.image = MeanImage(sums, result.samples_per_pixel, options);
  result.noise = EstimateNoise(sums, result.samples_per_pixel);
  for (const PixelSums& pixel : sums) result.rays += pixel.rays;
  return result;
}

}  // namespace treelight::client
