#include "client/render/pilot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "client/render/radius_probe.h"
#include "client/render/shrinking_radius.h"
#include "client/render/stopwatch.h"
#include "client/trace/random.h"

namespace treelight::client {
namespace {

constexpr std::uint64_t kPilotPhotons = 20'000;
constexpr std::uint32_t kPilotNeighbors = 96;
constexpr double kPilotPixels = 4096;
constexpr std::uint64_t kFirstSeed = std::uint64_t{1} << 62;  // passes that no run gets to
constexpr double kDark = 0.01;                                // as ImageError::relative_mse

/// Distance of the pixels that are looked at: 1, or even, so that the probe looks at all of them.
int PilotStride(int width, int height) {
  const double distance = std::sqrt(static_cast<double>(width) * height / kPilotPixels);
  constexpr int kStride = RadiusProbe::kStride;
  return distance <= 1 ? 1 : static_cast<int>(std::ceil(distance / kStride)) * kStride;
}

/// The maps of the pilot; deletes them.
class PilotMaps {
 public:
  PilotMaps(const Intersector& intersector, PhotonMapClient& client,
            const ProgressiveOptions& options)
      : intersector_(intersector),
        client_(client),
        options_(options),
        emitters_(intersector.scene()) {}

  ~PilotMaps() {
    for (const PassMaps& made : maps_) DeleteMaps(client_, made.maps).IgnoreError();  // they expire
  }

  /// Makes one more, with the radii of the first.
  absl::Status Make() {
    PassMapOptions make{
        .indirect_photons = options_.indirect_photons,
        .caustic_photons = options_.caustic_photons,
        .seed = PassSeed(options_.seed, kFirstSeed + maps_.size()),
        .upload = {.name = options_.map_name, .time_to_live = options_.time_to_live},
        .indirect = options_.indirect,
        .caustic = options_.caustic,
        .cancelled = options_.interrupted,
        .emitters = &emitters_};
    if (!maps_.empty()) {
      make.indirect.given = maps_[0].indirect_radius;
      make.caustic.given = maps_[0].caustic_radius;
    }
    auto made = MakePassMaps(intersector_, client_, make);
    if (made.ok()) maps_.push_back(*std::move(made));
    return made.status();
  }

  const PassMaps& operator[](std::size_t i) const { return maps_[i]; }

 private:
  const Intersector& intersector_;
  PhotonMapClient& client_;
  const ProgressiveOptions& options_;
  const PhotonEmitters emitters_;
  std::vector<PassMaps> maps_;
};

absl::StatusOr<PhotonRenderedImage> RenderPilot(const Intersector& intersector,
                                                PhotonMapClient& client, const PassMaps& maps,
                                                const ProgressiveOptions& options, int stride,
                                                std::uint64_t camera, double squared_scale) {
  PhotonRenderOptions render = options.pass;
  if (maps.indirect_radius) render.indirect.radius = *maps.indirect_radius;
  if (maps.caustic_radius) render.caustic.radius = *maps.caustic_radius;
  render.indirect = Shrink(render.indirect, squared_scale);
  render.caustic = Shrink(render.caustic, squared_scale);
  render.pixel_stride = stride;
  render.camera.samples_per_pixel = 1;
  render.camera.seed = PassSeed(options.seed, kFirstSeed + camera);
  if (maps.indirect_radius) render.camera.final_gather_min_distance = render.indirect.radius;
  render.probe_radii = true;
  render.preview = {};
  render.cancelled = options.interrupted;
  return RenderPhotonMaps(intersector, client, maps.maps, render);
}

/// Sum over channels of a * b, relative to the radiance `mean`.
double Product(const Rgb& a, const Rgb& b, const Rgb& mean) {
  const auto one = [](double x, double y, double m) { return x * y / (m * m + kDark); };
  return one(a.r, b.r, mean.r) + one(a.g, b.g, mean.g) + one(a.b, b.b, mean.b);
}

/// Pictures of two maps (rows) with two sets of camera rays, at the pilot's area; and of both maps,
/// each with rays of its own, at a quarter of it.
struct PilotPictures {
  std::array<std::array<PhotonRenderedImage, 2>, 2> whole;
  std::array<PhotonRenderedImage, 2> quarter;
};

void FindErrors(const PilotPictures& pictures, int stride, PilotFindings& findings) {
  double photons = 0, shared = 0, samples = 0, pixels = 0;
  double whole = 0, quarter = 0, probed = 0;
  const auto& [a, b] = pictures.whole;
  const Image& first = a[0].image;
  constexpr int kProbe = RadiusProbe::kStride;
  for (int y = 0; y < first.height; y += stride) {
    for (int x = 0; x < first.width; x += stride) {
      const auto i = std::size_t(y) * std::size_t(first.width) + std::size_t(x);
      const Rgb &a1 = a[0].image.pixels[i], &a2 = a[1].image.pixels[i], &b1 = b[0].image.pixels[i],
                &b2 = b[1].image.pixels[i];
      const Rgb mean = 0.25f * (a1 + a2 + b1 + b2);
      ++pixels;
      const Rgb by_photons_1 = a1 - b1, by_photons_2 = a2 - b2;
      const Rgb by_camera_a = a1 - a2, by_camera_b = b1 - b2;
      // Each difference has twice the variance of a picture.
      photons +=
          (Product(by_photons_1, by_photons_1, mean) + Product(by_photons_2, by_photons_2, mean)) /
          4;
      shared += Product(by_photons_1, by_photons_2, mean) / 2;
      samples +=
          (Product(by_camera_a, by_camera_a, mean) + Product(by_camera_b, by_camera_b, mean)) / 4;
      if (x % kProbe != 0 || y % kProbe != 0) continue;
      ++probed;
      const auto at = [&](const PhotonRenderedImage& picture) {
        const Image& difference = picture.radius_difference;
        return difference.pixels[std::size_t(y / kProbe) * std::size_t(difference.width) +
                                 std::size_t(x / kProbe)];
      };
      // Neither photons nor rays are the same in the factors: noise of the differences goes away.
      whole += (Product(at(a[0]), at(b[1]), mean) + Product(at(a[1]), at(b[0]), mean)) / 2;
      quarter += Product(at(pictures.quarter[0]), at(pictures.quarter[1]), mean);
    }
  }
  const auto mean_of = [](double sum, double count) { return std::max(0.0, sum) / (3 * count); };
  findings.photon_variance = mean_of(photons, pixels);
  findings.shared = photons > 0 ? std::clamp(shared / photons, 0.01, 1.0) : 1;
  // What the rays alone change is noise of the camera and of the photons that are not shared.
  findings.camera_variance = mean_of(samples - (1 - findings.shared) * photons, pixels);
  const DifferenceParts parts = SplitDifference(mean_of(whole, probed), mean_of(quarter, probed));
  findings.curve_difference = parts.curve;
  findings.rim_difference = parts.rim;
}

void FindTimes(const PilotPictures& pictures, int stride, PilotFindings& findings) {
  const Image& image = pictures.quarter[0].image;
  const auto along = [stride](int pixels) { return (pixels + stride - 1) / stride; };
  const double samples = static_cast<double>(along(image.width)) * along(image.height);
  // The least of several: what else runs on the machine makes them longer.
  const auto least = [](double a, double b) { return std::max(0.0, std::min(a, b)); };
  const auto& [a, b] = pictures.whole;
  const auto& [c, d] = pictures.quarter;
  findings.camera_s = least(c.camera_s, d.camera_s) / samples;
  findings.gather_s =
      least(least(a[0].device_s(), a[1].device_s()), least(b[0].device_s(), b[1].device_s())) /
      samples;
  findings.quarter_gather_s = least(c.device_s(), d.device_s()) / samples;
  const auto rest = [](const PhotonRenderedImage& picture) {
    return picture.seconds - picture.camera_s - picture.device_s();
  };
  findings.pass_s = least(rest(c), rest(d));
}

}  // namespace

absl::StatusOr<PilotReport> RunPilot(const Intersector& intersector, PhotonMapClient& client,
                                     const ProgressiveOptions& options) {
  const Stopwatch begin;
  PilotReport report;
  report.findings.photons = kPilotPhotons;
  report.findings.k = kPilotNeighbors;
  const ProgressiveOptions pilot =
      Planned(options, {.photons = kPilotPhotons, .k = kPilotNeighbors, .samples_per_pixel = 1});
  const int stride = PilotStride(pilot.pass.width, pilot.pass.height);
  PilotMaps maps(intersector, client, pilot);
  PilotPictures pictures;
  for (const int set : {0, 1}) {
    if (auto status = maps.Make(); !status.ok()) return status;
    report.photons += maps[set].photons;
    const auto render = [&](std::uint64_t camera, double squared_scale) {
      return RenderPilot(intersector, client, maps[set], pilot, stride, camera, squared_scale);
    };
    for (const int camera : {0, 1}) {
      auto picture = render(camera, 1);
      if (!picture.ok()) return picture.status();
      pictures.whole[set][camera] = *std::move(picture);
    }
    auto picture = render(set, 0.25);
    if (!picture.ok()) return picture.status();
    pictures.quarter[set] = *std::move(picture);
  }
  FindErrors(pictures, stride, report.findings);
  FindTimes(pictures, stride, report.findings);
  report.findings.photon_s =
      std::min(maps[0].seconds, maps[1].seconds) / static_cast<double>(kPilotPhotons);
  report.seconds = begin.Seconds();
  return report;
}

ProgressiveOptions Planned(const ProgressiveOptions& options, const PassPlan& plan) {
  ProgressiveOptions planned = options;
  const auto in_proportion = [](double value, double of, double to) { return value / of * to; };
  planned.indirect_photons = plan.photons;
  planned.caustic_photons = static_cast<std::uint64_t>(in_proportion(
      static_cast<double>(options.caustic_photons), static_cast<double>(options.indirect_photons),
      static_cast<double>(plan.photons)));
  planned.indirect.k = planned.pass.indirect.k = plan.k;
  const auto caustic_k = static_cast<std::uint32_t>(
      std::lround(in_proportion(options.caustic.k, options.indirect.k, plan.k)));
  planned.caustic.k = planned.pass.caustic.k = std::max(caustic_k, kMinProgressiveNeighbors);
  planned.pass.camera.samples_per_pixel = plan.samples_per_pixel;
  planned.known_squared_bias = plan.squared_bias;
  planned.constant_passes = std::max<std::uint64_t>(plan.passes, 1);
  return planned;
}

}  // namespace treelight::client
