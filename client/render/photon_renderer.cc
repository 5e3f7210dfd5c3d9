#include "client/render/photon_renderer.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <future>
#include <numeric>
#include <string_view>
#include <vector>

#include "client/render/radius_probe.h"
#include "client/render/stopwatch.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kRaysPerBatch = 65536;  // of the camera, and to gather from
constexpr std::size_t kMinSamplesPerBatch = 1024;
constexpr std::size_t kMaxOpenSamples = 1 << 22;
/// Gather rays at the diffuse hits of one pixel, at most: their strata are counted in float.
constexpr std::uint64_t kMaxStrata = 1 << 24;
constexpr std::size_t kMaxQueriesPerMessage = 131072;
constexpr std::uint64_t kBytesPerQuery = 24;
constexpr std::uint64_t kRestOfMessage = 65536;  // bytes, all but the queries

/// Samples of the camera whose light is not all there yet, in the order in which they were traced.
class OpenSamples {
 public:
  void Append(const std::vector<Rgb>& radiance) {
    radiance_.insert(radiance_.end(), radiance.begin(), radiance.end());
  }

  void Add(std::uint64_t sample, const Rgb& radiance) { radiance_[sample - first_] += radiance; }

  /// Moves the samples before `last` into `image`.
  void Complete(std::uint64_t last, const SampleOrder& order, ProgressiveImage& image) {
    for (; first_ < last && !radiance_.empty(); ++first_) {
      image.Add(order.At(first_).pixel, radiance_.front());
      radiance_.pop_front();
    }
  }

  std::uint64_t first() const { return first_; }
  std::size_t size() const { return radiance_.size(); }

 private:
  std::uint64_t first_ = 0;
  std::deque<Rgb> radiance_;
};

/// Queries that the server takes in one message.
absl::StatusOr<std::size_t> QueriesPerMessage(PhotonMapClient& client) {
  const auto info = client.GetServerInfo();
  if (!info.ok()) return info.status();
  const std::uint64_t bytes = info->limits().max_message_bytes();
  const std::uint64_t that_fit =
      bytes > kRestOfMessage ? (bytes - kRestOfMessage) / kBytesPerQuery : 1;
  return std::clamp<std::uint64_t>(std::min<std::uint64_t>(info->limits().max_queries(), that_fit),
                                   1, kMaxQueriesPerMessage);
}

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
  if (options.pixel_stride <= 0)
    return absl::InvalidArgumentError(fmt::format("pixel_stride is {}", options.pixel_stride));
  if (options.camera.samples_per_pixel == 0)
    return absl::InvalidArgumentError("samples_per_pixel is 0");
  if (options.camera.light_strata == 0) return absl::InvalidArgumentError("light_strata is 0");
  if (std::uint64_t{options.camera.samples_per_pixel} * options.camera.final_gather_rays >
      kMaxStrata) {
    return absl::InvalidArgumentError(fmt::format(
        "{} samples per pixel with {} gather rays each are over {} rays per pixel",
        options.camera.samples_per_pixel, options.camera.final_gather_rays, kMaxStrata));
  }
  if (!(options.camera.final_gather_min_distance >= 0)) {
    return absl::InvalidArgumentError(
        fmt::format("final_gather_min_distance is {}", options.camera.final_gather_min_distance));
  }
  if (const auto status = CheckEstimate("indirect", options.indirect); !status.ok()) return status;
  return CheckEstimate("caustic", options.caustic);
}

/// That the server's device was busy.
double DeviceSeconds(const GatherCost& cost) { return 1e-6 * (cost.kernel_us + cost.transfer_us); }

}  // namespace

double PhotonRenderedImage::device_s() const {
  return DeviceSeconds(indirect) + DeviceSeconds(caustic);
}

double PhotonRenderedImage::overlap_s() const {
  return std::max(0.0, camera_s + device_s() - seconds);
}

absl::StatusOr<PhotonRenderedImage> RenderPhotonMaps(const Intersector& intersector,
                                                     PhotonMapClient& client,
                                                     const PhotonMaps& maps,
                                                     const PhotonRenderOptions& options) {
  if (const auto status = CheckOptions(options); !status.ok()) return status;
  const auto max_queries = QueriesPerMessage(client);
  if (!max_queries.ok()) return max_queries.status();
  const Stopwatch begin;
  PhotonRenderedImage result;
  const CameraRays camera(intersector.scene().camera, options.width, options.height);
  const Lights lights(intersector.scene());
  const SampleOrder order(options.width, options.height, options.camera.samples_per_pixel,
                          options.pixel_stride);
  ProgressiveImage image(options.width, options.height);
  PreviewClock preview(options.preview);
  OpenSamples open;
  std::optional<RadiusProbe> probe;
  if (options.probe_radii) probe.emplace(order, options.width, options.height);
  const auto sink = [&](std::uint64_t sample, const Rgb& radiance) {
    open.Add(sample, radiance);
    if (probe) probe->AddWhole(sample, radiance);
  };
  std::optional<MapGather> indirect, caustic;
  if (maps.indirect) indirect.emplace(client, *maps.indirect, options.indirect, *max_queries, sink);
  if (maps.caustic) caustic.emplace(client, *maps.caustic, options.caustic, *max_queries, sink);

  const auto add_quarter = [&](std::uint64_t sample, const Rgb& radiance) {
    probe->AddQuarter(sample, radiance);
  };
  std::optional<MapGather> indirect_probe, caustic_probe;
  if (probe && indirect) {
    indirect_probe.emplace(client, *maps.indirect, QuarterOf(options.indirect), *max_queries,
                           add_quarter);
  }
  if (probe && caustic) {
    caustic_probe.emplace(client, *maps.caustic, QuarterOf(options.caustic), *max_queries,
                          add_quarter);
  }

  const auto add_to = [&](std::optional<MapGather>& gather, std::optional<MapGather>& gather_probe,
                          const GatherPoints& points, std::uint64_t first) {
    if (!gather) return absl::OkStatus();
    auto status = gather->Add(points, first);
    if (gather_probe && status.ok())
      status = gather_probe->Add(probe->Select(points, first), first);
    return status;
  };
  const auto add = [&](const CameraBatch& batch, std::uint64_t first) {
    const bool final_gather = options.camera.final_gather_rays > 0;
    auto status = add_to(indirect, indirect_probe,
                         final_gather ? batch.final_gather : batch.diffuse_hits, first);
    if (status.ok()) status = add_to(caustic, caustic_probe, batch.diffuse_hits, first);
    if (status.ok()) status = add_to(caustic, caustic_probe, batch.gather_caustics, first);
    return status;
  };
  const auto gathers = {&indirect, &caustic, &indirect_probe, &caustic_probe};
  const auto flush = [&] {
    absl::Status status;
    for (auto* gather : gathers) {
      if (*gather && status.ok()) status = (*gather)->Flush();
    }
    return status;
  };
  const auto show = [&](std::uint64_t traced) {
    if (indirect) traced = std::min(traced, indirect->answered_until());
    if (caustic) traced = std::min(traced, caustic->answered_until());
    open.Complete(traced, order, image);
    if (options.progress) options.progress(open.first());
    if (open.first() >= order.first_picture()) preview.Update([&image] { return image.Mean(); });
  };

  const std::size_t batch_size = std::max<std::size_t>(
      kMinSamplesPerBatch, kRaysPerBatch / (1 + options.camera.final_gather_rays));
  const auto trace = [&](std::uint64_t first) {
    const std::size_t count = std::min<std::uint64_t>(batch_size, order.size() - first);
    const Stopwatch tracing;
    auto batch = TraceCameraBatch(intersector, lights, camera, order, first, count, options.camera);
    result.camera_s += tracing.Seconds();  // one batch at a time is traced
    return batch;
  };
  // While a batch is sent and answers are taken, the next one is traced.
  std::future<CameraBatch> next = std::async(std::launch::async, trace, 0);
  for (std::uint64_t first = 0; first < order.size(); first += batch_size) {
    if (options.cancelled && options.cancelled())
      return absl::CancelledError("rendering was cancelled");
    const CameraBatch batch = next.get();
    if (first + batch_size < order.size())
      next = std::async(std::launch::async, trace, first + batch_size);
    const std::size_t count = batch.radiance.size();
    result.rays += batch.rays;
    open.Append(batch.radiance);
    if (const auto status = add(batch, first); !status.ok()) return status;
    show(first + count);
    // Where few samples ask for photons, messages fill slowly.
    if (open.size() > kMaxOpenSamples) {
      if (const auto status = flush(); !status.ok()) return status;
    }
  }
  if (const auto status = flush(); !status.ok()) return status;
  for (auto* gather : gathers) {
    while (*gather) {
      const auto more = (*gather)->Finish();
      if (!more.ok()) return more.status();
      if (!*more) break;
      show(order.size());
    }
  }
  show(order.size());

  result.image = image.Mean();
  if (indirect) result.indirect = indirect->cost();
  if (caustic) result.caustic = caustic->cost();
  if (probe) result.radius_difference = probe->Difference();
  if (indirect_probe) result.probe_s += DeviceSeconds(indirect_probe->cost());
  if (caustic_probe) result.probe_s += DeviceSeconds(caustic_probe->cost());
  result.seconds = begin.Seconds();
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
