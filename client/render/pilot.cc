#include "client/render/pilot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "client/render/radius_probe.h"
#include "client/render/stopwatch.h"
#include "client/trace/random.h"

namespace treelight::client {
namespace {

constexpr std::uint64_t kFirstSeed = std::uint64_t{1} << 62;  // passes that no run gets to
/// A larger pilot is made for a plan that takes so many times as long as the small one.
constexpr double kWorthwhile = 40;
constexpr double kDark = 0.01;  // as ImageError::relative_mse

/// Distance of the pixels that are looked at: 1, or even, so that the probe looks at all of them.
int PilotStride(int width, int height, std::uint64_t pixels) {
  const double distance =
      std::sqrt(static_cast<double>(width) * height / static_cast<double>(pixels));
  constexpr int kStride = RadiusProbe::kStride;
  return distance <= 1 ? 1 : static_cast<int>(std::ceil(distance / kStride)) * kStride;
}

/// The maps of the pilot; deletes them.
class PilotMaps {
 public:
  PilotMaps(const Intersector& intersector, PhotonMapClient& client,
            const ProgressiveOptions& options)
      : intersector_(intersector), client_(client), options_(options) {}

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
        .emitters = options_.emitters};
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
  std::vector<PassMaps> maps_;
};

/// Camera rays of a picture: which, and in which quarters of the pixels.
struct PilotRays {
  std::uint64_t camera = 0, quarters = 0;
};

absl::StatusOr<PhotonRenderedImage> RenderPilot(const Intersector& intersector,
                                                PhotonMapClient& client, const PassMaps& maps,
                                                const ProgressiveOptions& options, int stride,
                                                const PilotRays& rays) {
  PhotonRenderOptions render = options.pass;
  if (maps.indirect_radius) render.indirect.radius = *maps.indirect_radius;
  if (maps.caustic_radius) render.caustic.radius = *maps.caustic_radius;
  render.pixel_stride = stride;
  render.camera.samples_per_pixel = 1;
  render.camera.seed = PassSeed(options.seed, kFirstSeed + rays.camera);
  render.camera.quarter_seed = PassSeed(options.seed, kFirstSeed + rays.quarters);
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

/// Pictures of two maps (rows) with two sets of camera rays, at the pilot's area; of the first with
/// other rays in the quarters of the first set.
struct PilotPictures {
  std::array<std::array<PhotonRenderedImage, 2>, 2> whole;
  PhotonRenderedImage same_quarters;
};

void FindErrors(const PilotPictures& pictures, int stride, PilotFindings& findings) {
  double photons = 0, shared = 0, samples = 0, in_quarters = 0, pixels = 0;
  double blurred = 0, probed = 0;
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
      const Rgb in_quarter = a1 - pictures.same_quarters.image.pixels[i];
      in_quarters += Product(in_quarter, in_quarter, mean) / 2;
      if (x % kProbe != 0 || y % kProbe != 0) continue;
      ++probed;
      const auto at = [&](const PhotonRenderedImage& picture) {
        const Image& difference = picture.radius_difference;
        return difference.pixels[std::size_t(y / kProbe) * std::size_t(difference.width) +
                                 std::size_t(x / kProbe)];
      };
      // Neither photons nor rays are the same in the factors: noise of the differences goes away.
      blurred += (Product(at(a[0]), at(b[1]), mean) + Product(at(a[1]), at(b[0]), mean)) / 2;
    }
  }
  const auto mean_of = [](double sum, double count) { return std::max(0.0, sum) / (3 * count); };
  findings.photon_variance = mean_of(photons, pixels);
  findings.shared = photons > 0 ? std::clamp(shared / photons, 0.01, 1.0) : 1;
  // What the rays alone change is noise of the camera and of the photons that are not shared.
  const double unshared = (1 - findings.shared) * photons;
  findings.camera_variance = mean_of(samples - unshared, pixels);
  findings.within_quarter =
      samples > unshared ? std::clamp((in_quarters - unshared) / (samples - unshared), 0.0, 1.0)
                         : 1;
  findings.squared_difference = mean_of(blurred, probed);
}

void FindTimes(const PilotPictures& pictures, int stride, PilotFindings& findings) {
  const auto& [a, b] = pictures.whole;
  const auto along = [stride](int pixels) { return (pixels + stride - 1) / stride; };
  const double samples = static_cast<double>(along(a[0].image.width)) * along(a[0].image.height);
  // The least of several: what else runs on the machine makes them longer.
  const auto least = [&](auto seconds) {
    return std::max(0.0, std::min({seconds(a[0]), seconds(a[1]), seconds(b[0]), seconds(b[1])}));
  };
  using Picture = PhotonRenderedImage;
  findings.camera_s = least([](const Picture& p) { return p.camera_s; }) / samples;
  findings.gather_s = least([](const Picture& p) { return p.device_s(); }) / samples;
  findings.quarter_gather_s = least([](const Picture& p) { return p.probe_s; }) / samples;
  findings.pass_s =
      least([](const Picture& p) { return p.seconds - p.camera_s - p.device_s() - p.probe_s; });
}

}  // namespace

absl::StatusOr<PilotReport> RunPilot(const Intersector& intersector, PhotonMapClient& client,
                                     const ProgressiveOptions& options, const PilotSize& size) {
  const Stopwatch begin;
  PilotReport report;
  report.findings.photons = size.photons;
  report.findings.k = size.k;
  const ProgressiveOptions pilot =
      Planned(options, {.photons = size.photons, .k = size.k, .samples_per_pixel = 1});
  const int stride = PilotStride(pilot.pass.width, pilot.pass.height, size.pixels);
  PilotMaps maps(intersector, client, pilot);
  PilotPictures pictures;
  for (const int set : {0, 1}) {
    if (auto status = maps.Make(); !status.ok()) return status;
    report.photons += maps[set].photons;
    const auto render = [&](const PilotRays& rays, PhotonRenderedImage& to) {
      auto picture = RenderPilot(intersector, client, maps[set], pilot, stride, rays);
      if (picture.ok()) to = *std::move(picture);
      return picture.status();
    };
    auto status = render({.camera = 0, .quarters = 0}, pictures.whole[set][0]);
    if (status.ok()) status = render({.camera = 1, .quarters = 1}, pictures.whole[set][1]);
    if (status.ok() && set == 0)
      status = render({.camera = 2, .quarters = 0}, pictures.same_quarters);
    if (!status.ok()) return status;
  }
  FindErrors(pictures, stride, report.findings);
  FindTimes(pictures, stride, report.findings);
  report.findings.photon_s =
      std::min(maps[0].seconds, maps[1].seconds) / static_cast<double>(size.photons);
  report.seconds = begin.Seconds();
  return report;
}

absl::StatusOr<PilotPlan> PlanByPilots(const Intersector& intersector, PhotonMapClient& client,
                                       const ProgressiveOptions& options,
                                       const PlanLimits& limits) {
  const auto pixels = std::uint64_t(options.pass.width) * std::uint64_t(options.pass.height);
  PilotPlan planned;
  for (const PilotSize& size : {kSmallPilot, PilotSize{}}) {
    auto pilot = RunPilot(intersector, client, options, size);
    if (!pilot.ok()) return pilot.status();
    planned.plan = PlanPasses(pilot->findings, options.target_error, pixels, limits);
    pilot->photons += planned.pilot.photons, pilot->seconds += planned.pilot.seconds;
    planned.pilot = *std::move(pilot);
    if (planned.plan.seconds < kWorthwhile * planned.pilot.seconds) break;
  }
  return planned;
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
