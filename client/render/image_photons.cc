#include "client/render/image_photons.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "client/render/camera_rays.h"
#include "client/trace/random.h"
#include "client/trace/scatter.h"
#include "fmt/format.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

constexpr int kTile = 4;  // pixels: a tile is a packet of rays
static_assert(kTile * kTile == kPacketSize);
constexpr std::uint64_t kTilesPerBatch = 64;
constexpr std::uint64_t kBatchesPerRound = 128;

/// What the paths of some tiles generated.
struct Batch {
  std::vector<Vec3> positions;
  std::uint64_t paths = 0, rays = 0;
};

class Tracer {
 public:
  Tracer(const Intersector& intersector, const ImagePhotonOptions& options)
      : intersector_(intersector),
        options_(options),
        camera_(intersector.scene().camera, options.width, options.height),
        tiles_across_((options.width + kTile - 1) / kTile),
        tiles_down_((options.height + kTile - 1) / kTile) {}

  /// A tile, once for each sample.
  std::uint64_t tile_count() const {
    return std::uint64_t(tiles_across_) * tiles_down_ * options_.samples_per_pixel;
  }

  Batch TraceTiles(std::uint64_t first, std::uint64_t last) const {
    Batch batch;
    for (std::uint64_t tile = first; tile < last; ++tile) TraceTile(tile, batch);
    return batch;
  }

 private:
  void TraceTile(std::uint64_t index, Batch& batch) const {
    const auto sample = static_cast<std::uint32_t>(index % options_.samples_per_pixel);
    const auto tile = static_cast<int>(index / options_.samples_per_pixel);
    std::vector<Ray> rays;
    std::vector<RandomStream> randoms;
    for (int i = 0; i < kTile * kTile; ++i) {
      const int x = tile % tiles_across_ * kTile + i % kTile;
      const int y = tile / tiles_across_ * kTile + i / kTile;
      if (x >= options_.width || y >= options_.height) continue;
      const auto pixel = std::uint64_t(y) * options_.width + x;
      RandomStream& random = randoms.emplace_back(options_.seed, RandomPurpose::kImagePath,
                                                  pixel * options_.samples_per_pixel + sample);
      const float u = random.Uniform(), v = random.Uniform();
      rays.push_back(camera_.Through(static_cast<float>(x) + u, static_cast<float>(y) + v));
    }
    const auto hits = intersector_.IntersectPacket(rays);
    batch.paths += rays.size(), batch.rays += rays.size();
    for (std::size_t i = 0; i < rays.size(); ++i) Follow(rays[i], hits[i], randoms[i], batch);
  }

  void Follow(Ray ray, std::optional<Hit> hit, RandomStream& random, Batch& batch) const {
    for (std::uint32_t bounce = 0; hit; ++bounce) {
      const Surface surface = hit->material->surface;
      if (surface == Surface::kDiffuse || surface == Surface::kGlossy)
        batch.positions.push_back(hit->position);
      if (bounce == options_.max_bounces) return;
      const float u = random.Uniform(), v = random.Uniform(), survival = random.Uniform();
      const auto scattering = SampleScattering(ray, *hit, PathFrom::kCamera, u, v);
      if (!scattering || !(survival < MaxChannel(scattering->weight))) return;
      ray = LeaveSurface(*hit, scattering->direction);
      ++batch.rays;
      hit = intersector_.Intersect(ray);
    }
  }

  const Intersector& intersector_;
  const ImagePhotonOptions& options_;
  CameraRays camera_;
  int tiles_across_, tiles_down_;
};

/// A uniform choice of `count` of all that are offered.
class Reservoir {
 public:
  Reservoir(std::uint64_t count, std::uint64_t seed)
      : count_(count), random_(seed, RandomPurpose::kImageChoice, 0) {}

  void Offer(const Vec3& position) {
    ++offered_;
    if (offered_ <= count_) {
      positions_.insert(positions_.end(), {position.x, position.y, position.z});
      return;
    }
    const auto place =
        static_cast<std::uint64_t>(random_.FineUniform() * static_cast<double>(offered_));
    if (place >= count_) return;
    float* const replaced = &positions_[3 * place];
    replaced[0] = position.x, replaced[1] = position.y, replaced[2] = position.z;
  }

  std::uint64_t offered() const { return offered_; }
  std::vector<float>& positions() { return positions_; }

 private:
  std::uint64_t count_, offered_ = 0;
  RandomStream random_;
  std::vector<float> positions_;
};

absl::Status CheckOptions(const ImagePhotonOptions& options) {
  if (options.width <= 0 || options.height <= 0) {
    return absl::InvalidArgumentError(
        fmt::format("a picture of {} x {} pixels", options.width, options.height));
  }
  if (options.count == 0) return absl::InvalidArgumentError("count is 0");
  if (options.samples_per_pixel == 0) return absl::InvalidArgumentError("samples_per_pixel is 0");
  if (options.max_bounces == 0) return absl::InvalidArgumentError("max_bounces is 0");
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ImagePhotons> TraceImagePhotons(const Intersector& intersector,
                                               const ImagePhotonOptions& options) {
  if (const auto status = CheckOptions(options); !status.ok()) return status;
  const Tracer tracer(intersector, options);
  Reservoir reservoir(options.count, options.seed);
  ImagePhotons photons;
  constexpr std::uint64_t kTilesPerRound = kTilesPerBatch * kBatchesPerRound;
  for (std::uint64_t first = 0; first < tracer.tile_count(); first += kTilesPerRound) {
    const std::uint64_t last = std::min(first + kTilesPerRound, tracer.tile_count());
    std::vector<Batch> batches((last - first + kTilesPerBatch - 1) / kTilesPerBatch);
    tbb::parallel_for(std::size_t{0}, batches.size(), [&](std::size_t i) {
      const std::uint64_t begin = first + i * kTilesPerBatch;
      batches[i] = tracer.TraceTiles(begin, std::min(begin + kTilesPerBatch, last));
    });
    for (const Batch& batch : batches) {
      for (const Vec3& position : batch.positions) reservoir.Offer(position);
      photons.paths += batch.paths, photons.rays += batch.rays;
    }
    if (options.progress) options.progress(photons.paths);
  }
  photons.generated = reservoir.offered();
  if (photons.generated < options.count) {
    return absl::FailedPreconditionError(
        fmt::format("{} paths generated {} image photons, {} are to be chosen: take more samples "
                    "per pixel, or a camera that sees more of the scene",
                    photons.paths, photons.generated, options.count));
  }
  photons.positions = std::move(reservoir.positions());
  return photons;
}

}  // namespace treelight::client
