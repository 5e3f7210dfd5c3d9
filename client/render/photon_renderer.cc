#include "client/render/photon_renderer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kSamplesPerBatch = 32768;  // of the camera
constexpr std::size_t kQueriesPerMessage = 65536;

/// Runs `work` and adds the seconds that it took to `seconds`.
template <typename Work>
auto Timed(double& seconds, Work work) {
  const auto begin = std::chrono::steady_clock::now();
  auto result = work();
  seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

/// The gathers of one map: camera batches go in, irradiances come out in the same order.
class MapGather {
 public:
  MapGather(PhotonMapClient& client, const MapRef& map, const EstimateOptions& estimate)
      : pipeline_(client, map,
                  {.k = estimate.k, .radius = estimate.radius, .outputs = kOutputDensity}) {}

  absl::Status Send(const CameraBatch& batch) {
    const std::span<const float> positions(batch.positions), normals(batch.normals);
    for (std::size_t first = 0; first < batch.size(); first += kQueriesPerMessage) {
      const std::size_t count = std::min(kQueriesPerMessage, batch.size() - first);
      const auto status = pipeline_.Send({.positions = positions.subspan(3 * first, 3 * count),
                                          .normals = normals.subspan(3 * first, 3 * count),
                                          .radii = {}});
      if (!status.ok()) return status;
    }
    // The sample, at even distances over all batches.
    for (; next_sample_ < cost_.queries + batch.size(); next_sample_ += kSampleStride) {
      const auto position = positions.subspan(3 * (next_sample_ - cost_.queries), 3);
      cost_.sample.insert(cost_.sample.end(), position.begin(), position.end());
    }
    cost_.queries += batch.size();
    return absl::OkStatus();
  }

  /// Waits for the answer to the oldest batch, and adds it to the pixels, of which `pixels` is the
  /// first.
  absl::Status Receive(const CameraBatch& batch, Rgb* pixels) {
    for (std::size_t first = 0; first < batch.size(); first += kQueriesPerMessage) {
      const auto answer = pipeline_.Receive();
      if (!answer.ok()) return answer.status();
      cost_.kernel_us += answer->timings.kernel_us();
      const std::vector<float>& densities = answer->result.densities;
      for (std::size_t i = 0; 3 * i < densities.size(); ++i) {
        pixels[batch.pixels[first + i]] +=
            batch.weights[first + i] *
            Rgb{densities[3 * i], densities[3 * i + 1], densities[3 * i + 2]};
      }
    }
    return absl::OkStatus();
  }

  const GatherCost& cost() const { return cost_; }

 private:
  GatherPipeline pipeline_;
  GatherCost cost_;
  std::uint64_t next_sample_ = 0;
};

/// A camera batch on its way: its first pixel and, as long as the server works on it, what it
/// asked.
struct Pending {
  std::size_t first_pixel = 0;
  CameraBatch batch;
};

absl::Status CheckEstimate(std::string_view name, const EstimateOptions& estimate) {
  if (estimate.k > kMaxNeighbors) {
    return absl::InvalidArgumentError(
        fmt::format("{}: k {} is over {}", name, estimate.k, kMaxNeighbors));
  }
  if (!(estimate.radius > 0) || std::isinf(estimate.radius)) {
    return absl::InvalidArgumentError(
        fmt::format("{}: radius {} is not positive and finite", name, estimate.radius));
  }
  return absl::OkStatus();
}

absl::Status CheckOptions(const PhotonRenderOptions& options) {
  if (options.width <= 0 || options.height <= 0) {
    return absl::InvalidArgumentError(
        fmt::format("a picture of {} x {} pixels", options.width, options.height));
  }
  if (options.camera.samples_per_pixel == 0)
    return absl::InvalidArgumentError("samples_per_pixel is 0");
  if (options.camera.light_strata == 0) return absl::InvalidArgumentError("light_strata is 0");
  if (const auto status = CheckEstimate("indirect", options.indirect); !status.ok()) return status;
  return CheckEstimate("caustic", options.caustic);
}

}  // namespace

absl::StatusOr<PhotonRenderedImage> RenderPhotonMaps(const Intersector& intersector,
                                                     PhotonMapClient& client,
                                                     const PhotonMaps& maps,
                                                     const PhotonRenderOptions& options) {
  if (const auto status = CheckOptions(options); !status.ok()) return status;
  PhotonRenderedImage result{.image = Image(options.width, options.height)};
  const CameraRays camera(intersector.scene().camera, options.width, options.height);
  const Lights lights(intersector.scene());
  std::optional<MapGather> indirect, caustic;
  if (maps.indirect) indirect.emplace(client, *maps.indirect, options.indirect);
  if (maps.caustic) caustic.emplace(client, *maps.caustic, options.caustic);
  std::vector<Rgb>& pixels = result.image.pixels;

  const auto send = [&](const CameraBatch& batch) {
    absl::Status status;
    if (indirect) status.Update(indirect->Send(batch));
    if (caustic) status.Update(caustic->Send(batch));
    return status;
  };
  const auto receive = [&](const Pending& pending) {
    absl::Status status;
    Rgb* const first = pixels.data() + pending.first_pixel;
    if (indirect) status.Update(indirect->Receive(pending.batch, first));
    if (caustic && status.ok()) status.Update(caustic->Receive(pending.batch, first));
    if (options.progress) options.progress(pending.first_pixel + pending.batch.radiance.size());
    return status;
  };

  // Trace a batch and send it, then take the answer to the one before.
  const std::size_t batch_pixels =
      std::max<std::size_t>(1, kSamplesPerBatch / options.camera.samples_per_pixel);
  std::optional<Pending> sent;
  for (std::size_t first = 0; first < pixels.size(); first += batch_pixels) {
    const std::size_t count = std::min(batch_pixels, pixels.size() - first);
    Pending traced{first, Timed(result.camera_s, [&] {
                     return TraceCameraBatch(intersector, lights, camera, options.width, first,
                                             count, options.camera);
                   })};
    result.rays += traced.batch.rays;
    std::ranges::copy(traced.batch.radiance, pixels.begin() + static_cast<std::ptrdiff_t>(first));
    auto status = Timed(result.wait_s, [&] { return send(traced.batch); });
    if (status.ok() && sent) status = Timed(result.wait_s, [&] { return receive(*sent); });
    if (!status.ok()) return status;
    sent = std::move(traced);
  }
  if (const auto status = Timed(result.wait_s, [&] { return receive(*sent); }); !status.ok())
    return status;

  if (indirect) result.indirect = indirect->cost();
  if (caustic) result.caustic = caustic->cost();
  return result;
}

absl::StatusOr<TraversalCost> GatherSample(PhotonMapClient& client, const MapRef& map,
                                           const EstimateOptions& estimate,
                                           const std::vector<float>& sample) {
  const auto answer =
      client.Gather(map, {.positions = sample, .normals = {}, .radii = {}},
                    {.k = estimate.k, .radius = estimate.radius, .outputs = kOutputStatistics});
  if (!answer.ok()) return answer.status();
  const auto mean = [](const std::vector<std::uint32_t>& counts) {
    return std::accumulate(counts.begin(), counts.end(), 0.0) / static_cast<double>(counts.size());
  };
  return TraversalCost{.nodes_per_query = mean(answer->result.nodes_visited),
                       .tests_per_query = mean(answer->result.distance_tests)};
}

}  // namespace treelight::client
