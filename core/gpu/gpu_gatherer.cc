#include "core/gpu/gpu_gatherer.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <mutex>
#include <numeric>
#include <optional>
#include <utility>

#include "core/device/guard.h"
#include "core/device/stage_timer.h"
#include "core/gpu/batch_buffers.h"
#include "core/gpu/paced_launches.h"
#include "core/gpu/photon_powers.h"
#include "core/gpu/query_order.h"
#include "core/gpu/search_choice.h"
#include "core/gpu/wide_search.h"
#include "core/model/power_moments.h"
#include "fmt/format.h"

namespace treelight {
namespace {

// From this many queries on, sorting them pays.
constexpr std::size_t kSortedQueries = 4096;
// Space for heaps in global memory, where k is too large for local memory.
constexpr std::size_t kGlobalHeapBytes = std::size_t{256} << 20;

/// The lists of a gather without a cap, as GatherResult holds them.
struct NeighborLists {
  std::vector<std::uint64_t> offsets;
  std::vector<std::uint32_t> ids;
  std::vector<float> squared_distances;
};

/// gather_nearest of approximate gathers, which are rare: compiled, or taken from the cache, by the
/// first.
cl::Program ApproximateNearest(const Gpu& gpu, const std::string& heaps) {
  return gpu.device->Program({"traverse.cl", "heap.cl", "gather_nearest.cl"},
                             heaps + " -DAPPROXIMATE=1");
}

class GpuGatherer : public Gatherer {
 public:
  explicit GpuGatherer(DeviceMap map) : map_(std::move(map)) {}

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    if (const auto status = CheckGather(*this, queries, options); !status.ok()) return status;
    if (const auto status = CheckFits(queries, options); !status.ok()) return status;
    const std::lock_guard lock(map_.gpu.device->mutex());
    return Guard(
        [&]() -> absl::StatusOr<GatherResult> { return Run(queries, options, cancelled); });
  }

  absl::StatusOr<Tree> ReadTree() const override {
    const std::lock_guard lock(map_.gpu.device->mutex());
    return Guard([&]() -> absl::StatusOr<Tree> {
      const cl::CommandQueue& queue = map_.gpu.queue();
      return Tree{.kind = map_.kind,
                  .max_leaf_size = map_.max_leaf_size,
                  .root = map_.tree.root,
                  .nodes = map_.tree.nodes.Read(queue),
                  .min_ids = map_.tree.min_ids.Read(queue),
                  .photons = map_.tree.photons.Read(queue)};
    });
  }

  absl::StatusOr<Photons> ReadPhotons() const override {
    const std::lock_guard lock(map_.gpu.device->mutex());
    return Guard([&]() -> absl::StatusOr<Photons> {
      const cl::CommandQueue& queue = map_.gpu.queue();
      const std::vector<PhotonPower> carried = map_.powers.Read(queue);
      Photons photons;
      photons.positions = PositionsById(map_.tree.photons.Read(queue));
      if (map_.has_powers) photons.powers = PowersOf(carried);
      if (map_.has_directions) photons.directions = DirectionsOf(carried);
      return photons;
    });
  }

  std::size_t photon_count() const override { return map_.photon_count; }
  bool has_powers() const override { return map_.has_powers; }
  bool has_directions() const override { return map_.has_directions; }
  const BuildReport& report() const override { return map_.report; }

 private:
  absl::Status CheckFits(const GatherQueries& queries, const GatherOptions& options) const;
  GatherResult Run(const GatherQueries& queries, const GatherOptions& options,
                   const CancelCheck& cancelled) const;
  GatherParams MakeParams(const GatherQueries& queries, const GatherOptions& options) const;
  void GatherNearest(const BatchBuffers& batch, GatherParams params, std::size_t count,
                     const Approximation& approximation, const CancelCheck& cancelled) const;
  void GatherWithin(DeviceSearch search, const BatchBuffers& batch, GatherParams params,
                    std::size_t count, const CancelCheck& cancelled) const;
  void GatherRange(const BatchBuffers& batch, GatherParams params, std::size_t count,
                   const CancelCheck& cancelled) const;
  void GatherSums(const BatchBuffers& batch, GatherParams params, std::size_t count,
                  const CancelCheck& cancelled) const;
  NeighborLists GatherLists(const BatchBuffers& batch, GatherParams params, std::size_t count,
                            const GatherOptions& options, const CancelCheck& cancelled) const;

  SearchChoice Choose(const GatherOptions& options) const {
    return ChooseSearch(options, map_.wide.boxes.size() > 0, map_.has_powers);
  }

  WideSearch Wide(const BatchBuffers& batch, const GatherParams& params, std::size_t count,
                  const CancelCheck& cancelled) const {
    return {map_, batch, params, count, pace_, cancelled};
  }

  // A CPU runs the items of a group one after the other: small groups balance better. A GPU wants
  // at least two sub-groups of 32.
  std::size_t GatherGroupSize() const { return map_.gpu.device->is_cpu() ? 16 : 64; }

  DeviceMap map_;
  /// Of whoever holds the device's mutex.
  mutable LaunchPace pace_;
  /// Of the powers; computed by the first gather that adds up whole subtrees, which holds the
  /// device's mutex.
  mutable std::optional<Buffer<PowerMoments>> moments_;
};

absl::Status GpuGatherer::CheckFits(const GatherQueries& queries,
                                    const GatherOptions& options) const {
  if (options.k == 0 || (options.outputs & kOutputNeighbors) == 0) return absl::OkStatus();
  const std::uint64_t bytes = queries.size() * options.k * sizeof(cl_uint);
  const std::uint64_t limit = map_.gpu.device->info().max_buffer_bytes;
  if (bytes <= limit) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      fmt::format("neighbors: {} queries with k {} need a buffer of {} bytes, the device allows "
                  "{}: ask for at most "
                  "{} queries at once",
                  queries.size(), options.k, bytes, limit, limit / (options.k * sizeof(cl_uint))));
}

GatherParams GpuGatherer::MakeParams(const GatherQueries& queries,
                                     const GatherOptions& options) const {
  GatherParams params{};
  params.root = map_.tree.root;
  params.k = options.k;
  params.radius = options.radius;
  params.outputs = map_.has_powers ? options.outputs : options.outputs & ~kOutputDensity;
  params.density_kernel = static_cast<cl_uint>(options.kernel);
  params.has_order = queries.size() >= kSortedQueries ? 1 : 0;
  params.has_radii = queries.radii.empty() ? 0 : 1;
  params.has_normals = queries.normals.empty() ? 0 : 1;
  params.squared_stretch = options.approximation.squared_stretch();
  params.max_leaves =
      options.approximation.max_leaves > 0 ? options.approximation.max_leaves : CL_UINT_MAX;
  constexpr float kPeakWeights[] = {1, 3, 2};  // of the density kernels
  params.largest_weight_error =
      options.approximation.weight_tolerance * kPeakWeights[params.density_kernel];
  return params;
}

GatherResult GpuGatherer::Run(const GatherQueries& queries, const GatherOptions& options,
                              const CancelCheck& cancelled) const {
  const Gpu& gpu = map_.gpu;
  const std::size_t m = queries.size();
  GatherResult result;
  GatherParams params = MakeParams(queries, options);
  StageTimer timer(gpu.queue());
  std::optional<QueryOrder> order;
  if (params.has_order != 0) order.emplace(gpu);
  BatchBuffers batch = UploadBatch(gpu, queries, options);
  timer.Mark("upload");

  batch.order =
      order ? order->Find(batch.positions, m, map_.grid) : Buffer<cl_uint>(gpu.memory(), 0);
  const SearchChoice choice = Choose(options);
  result.search = choice.reason;
  if (choice.search == DeviceSearch::kGatherWide) {
    Wide(batch, params, m, cancelled).GatherWide();
  } else if (choice.search == DeviceSearch::kGatherLong) {
    Wide(batch, params, m, cancelled).GatherLong();
  } else if (choice.search == DeviceSearch::kGatherNearest) {
    GatherNearest(batch, params, m, options.approximation, cancelled);
  } else if (choice.search == DeviceSearch::kGatherList) {
    NeighborLists lists = GatherLists(batch, params, m, options, cancelled);
    result.neighbor_ids = std::move(lists.ids);
    result.neighbor_squared_distances = std::move(lists.squared_distances);
    result.neighbor_offsets = std::move(lists.offsets);
  } else {
    GatherWithin(choice.search, batch, params, m, cancelled);
  }
  timer.Mark("kernel");

  const cl::CommandQueue& queue = gpu.queue();
  if ((options.outputs & kOutputCount) != 0) result.counts = batch.counts.Read(queue);
  result.radii = batch.radii.Read(queue);
  result.densities =
      map_.has_powers ? batch.densities.Read(queue) : std::vector<float>(batch.densities.size());
  if (options.k > 0 || map_.has_powers) {
    result.error_bounds = batch.error_bounds.Read(queue);
  } else {
    result.error_bounds.resize(batch.error_bounds.size());  // of no density
  }
  result.nodes_visited = batch.visited.Read(queue);
  result.distance_tests = batch.tested.Read(queue);
  if (options.k > 0) {
    result.neighbor_ids = batch.neighbor_ids.Read(queue);
    result.neighbor_squared_distances = batch.neighbor_d2.Read(queue);
  }
  timer.Mark("download");
  const std::vector<StageTime> stages = timer.Finish();
  result.times = {stages[0].microseconds, stages[1].microseconds, stages[2].microseconds};
  return result;
}

void GpuGatherer::GatherNearest(const BatchBuffers& batch, GatherParams params, std::size_t count,
                                const Approximation& approximation,
                                const CancelCheck& cancelled) const {
  const Gpu& gpu = map_.gpu;
  const std::size_t group = GatherGroupSize();
  // The heaps lie in local memory while that leaves room for another group beside this one.
  const std::size_t local_bytes = params.k * group * sizeof(cl_ulong);
  const bool fits = local_bytes <= gpu.device->local_memory_bytes() / 2 + 2048;
  std::size_t per_launch = QueriesPerLaunch(map_.gpu);
  if (!fits) {
    per_launch =
        std::min(per_launch, kGlobalHeapBytes / (params.k * sizeof(cl_ulong)) / group * group);
  }
  per_launch = std::min(per_launch, (count + group - 1) / group * group);
  const auto launch = [&](const cl::Program& program, const auto&... heaps_and_bounds) {
    PacedLaunches(gpu, pace_, params, count, per_launch, cancelled, [&](const GatherParams& part) {
      Launch(gpu, program, "gather_nearest", part.count, group, map_.tree.nodes.get(),
             map_.tree.min_ids.get(), map_.tree.photons.get(), map_.powers.get(),
             batch.positions.get(), batch.order.get(), batch.radii_in.get(), batch.normals.get(),
             part, batch.counts.get(), batch.radii.get(), batch.neighbor_ids.get(),
             batch.neighbor_d2.get(), batch.densities.get(), batch.visited.get(),
             batch.tested.get(), heaps_and_bounds...);
    });
  };
  const auto launch_as_asked = [&](const cl::Program& exact, const char* heap_options,
                                   const auto& heaps) {
    if (!approximation.any()) return launch(exact, heaps);
    launch(ApproximateNearest(gpu, heap_options), heaps, batch.error_bounds.get());
  };
  if (fits) {
    launch_as_asked(gpu.gather, "-DHEAP_SPACE=local", cl::Local(local_bytes));
  } else {
    launch_as_asked(gpu.gather_global, "-DHEAP_SPACE=global -DHEAPS_GLOBAL=1",
                    Buffer<cl_ulong>(gpu.memory(), per_launch * params.k).get());
  }
}

void GpuGatherer::GatherWithin(DeviceSearch search, const BatchBuffers& batch, GatherParams params,
                               std::size_t count, const CancelCheck& cancelled) const {
  if (search == DeviceSearch::kGatherSums) return GatherSums(batch, params, count, cancelled);
  if (search == DeviceSearch::kCountWide) return Wide(batch, params, count, cancelled).CountWide();
  if (search == DeviceSearch::kDensityWide) {
    return Wide(batch, params, count, cancelled).DensityWide();
  }
  GatherRange(batch, params, count, cancelled);
}

void GpuGatherer::GatherRange(const BatchBuffers& batch, GatherParams params, std::size_t count,
                              const CancelCheck& cancelled) const {
  const Gpu& gpu = map_.gpu;
  PacedLaunches(gpu, pace_, params, count, QueriesPerLaunch(map_.gpu), cancelled,
                [&](const GatherParams& part) {
                  Launch(gpu, gpu.gather, "gather_range", part.count, GatherGroupSize(),
                         map_.tree.nodes.get(), map_.tree.photons.get(), map_.powers.get(),
                         batch.positions.get(), batch.order.get(), batch.radii_in.get(),
                         batch.normals.get(), part, batch.counts.get(), batch.radii.get(),
                         batch.densities.get(), batch.visited.get(), batch.tested.get());
                });
}

void GpuGatherer::GatherSums(const BatchBuffers& batch, GatherParams params, std::size_t count,
                             const CancelCheck& cancelled) const {
  const Gpu& gpu = map_.gpu;
  const cl::Program program = gpu.device->Program({"traverse.cl", "gather_sums.cl"});
  if (!moments_) {
    const Tree tree{.root = map_.tree.root,
                    .nodes = map_.tree.nodes.Read(gpu.queue()),
                    .min_ids = map_.tree.min_ids.Read(gpu.queue()),
                    .photons = map_.tree.photons.Read(gpu.queue())};
    moments_ = MakeBuffer<PowerMoments>(
        gpu.memory(), gpu.queue(), ComputeMoments(tree, PowersOf(map_.powers.Read(gpu.queue()))));
  }
  PacedLaunches(gpu, pace_, params, count, QueriesPerLaunch(map_.gpu), cancelled,
                [&](const GatherParams& part) {
                  Launch(gpu, program, "gather_sums", part.count, GatherGroupSize(),
                         map_.tree.nodes.get(), moments_->get(), map_.tree.photons.get(),
                         map_.powers.get(), batch.positions.get(), batch.order.get(),
                         batch.radii_in.get(), part, batch.counts.get(), batch.radii.get(),
                         batch.densities.get(), batch.visited.get(), batch.tested.get(),
                         batch.error_bounds.get());
                });
}

NeighborLists GpuGatherer::GatherLists(const BatchBuffers& batch, GatherParams params,
                                       std::size_t count, const GatherOptions& options,
                                       const CancelCheck& cancelled) const {
  // The counts tell where each list begins.
  const Gpu& gpu = map_.gpu;
  GatherParams counting = params;
  counting.outputs |= kOutputCount;
  GatherOptions beside_lists = options;
  beside_lists.outputs &= ~kOutputNeighbors;
  GatherWithin(Choose(beside_lists).search, batch, counting, count, cancelled);
  const std::vector<cl_uint> counts = batch.counts.Read(gpu.queue());
  NeighborLists lists;
  lists.offsets.assign(count + 1, 0);
  std::inclusive_scan(counts.begin(), counts.end(), lists.offsets.begin() + 1, std::plus<>(),
                      std::uint64_t{0});
  const std::uint64_t total = lists.offsets.back();
  if (const auto status = CheckNeighborCount(total, options); !status.ok())
    throw StatusError(status);
  if (total * sizeof(cl_ulong) > gpu.device->info().max_buffer_bytes) {
    throw StatusError(absl::ResourceExhaustedError(
        fmt::format("neighbors: the lists of {} queries hold {} photons, a buffer of the device "
                    "holds {}: ask for "
                    "fewer queries at once or a smaller radius",
                    count, total, gpu.device->info().max_buffer_bytes / sizeof(cl_ulong))));
  }
  const std::vector<cl_ulong> firsts(lists.offsets.begin(), lists.offsets.end());
  const auto offsets = MakeBuffer<cl_ulong>(gpu.memory(), gpu.queue(), firsts);
  const Buffer<cl_ulong> candidates(gpu.memory(), total);
  PacedLaunches(gpu, pace_, params, count, QueriesPerLaunch(map_.gpu), cancelled,
                [&](const GatherParams& part) {
                  Launch(gpu, gpu.gather_global, "gather_list", part.count, GatherGroupSize(),
                         map_.tree.nodes.get(), map_.tree.photons.get(), batch.positions.get(),
                         batch.order.get(), batch.radii_in.get(), part, offsets.get(),
                         candidates.get());
                });
  const std::vector<cl_ulong> found = candidates.Read(gpu.queue());
  lists.ids.resize(total);
  lists.squared_distances.resize(total);
  for (std::uint64_t i = 0; i < total; ++i) {
    lists.ids[i] = static_cast<std::uint32_t>(found[i]);
    lists.squared_distances[i] = std::bit_cast<float>(static_cast<std::uint32_t>(found[i] >> 32));
  }
  return lists;
}

}  // namespace

std::unique_ptr<Gatherer> MakeGpuGatherer(DeviceMap map) {
  return std::make_unique<GpuGatherer>(std::move(map));
}

}  // namespace treelight
