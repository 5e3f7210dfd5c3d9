#include "core/gpu/gpu_builder.h"

#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "core/cpu/cpu_builder.h"
#include "core/device/guard.h"
#include "core/device/stage_timer.h"
#include "core/gpu/bounds.h"
#include "core/gpu/gpu_gatherer.h"
#include "core/gpu/hierarchy.h"
#include "core/gpu/leaves.h"
#include "core/gpu/morton.h"
#include "core/gpu/photon_powers.h"
#include "core/gpu/placed_photons.h"
#include "core/gpu/radix_sort.h"
#include "core/gpu/sample_radius.h"
#include "core/gpu/split_levels.h"
#include "core/gpu/statistics.h"
#include "core/gpu/sweep.h"
#include "core/gpu/ties.h"
#include "core/gpu/treelets.h"
#include "core/model/morton_grid.h"
#include "core/model/tree.h"
#include "fmt/format.h"

namespace treelight {
namespace {

/// RESOURCE_EXHAUSTED where a map of these photons cannot lie on the device; names the limit.
absl::Status CheckFits(const DeviceInfo& device, const Photons& photons,
                       const BuildOptions& options) {
  const std::uint64_t largest =
      photons.size() * sizeof(LeafPhoton);  // no other array of a map is larger
  if (largest > device.max_buffer_bytes) {
    return absl::ResourceExhaustedError(fmt::format(
        "photons: {} need a buffer of {} bytes, device {} allows {} bytes, that is {} photons",
        photons.size(), largest, device.name, device.max_buffer_bytes,
        device.max_buffer_bytes / sizeof(LeafPhoton)));
  }
  if (photons.size() > kMaxSortedPairs) {
    return absl::ResourceExhaustedError(
        fmt::format("photons: {}, a device sorts at most {}", photons.size(), kMaxSortedPairs));
  }
  const std::uint64_t code_bytes = options.morton_bits == MortonBits::k63 ? 8 : 4;
  const std::uint64_t build_bytes =
      photons.size() * (12 + 16 + 2 * (code_bytes + 4) + 4 + 1) + 4 * photons.powers.size() +
      2 * photons.directions.size() +
      (photons.powers.empty() && photons.directions.empty() ? 0
                                                            : photons.size() * sizeof(PhotonPower));
  if (build_bytes > device.memory_bytes) {
    return absl::ResourceExhaustedError(
        fmt::format("photons: {} need about {} bytes to build, device {} has {}", photons.size(),
                    build_bytes, device.name, device.memory_bytes));
  }
  return absl::OkStatus();
}

/// The photons in Morton order, with the level of each boundary between neighbours.
struct SortedPhotons {
  Buffer<cl_uint> ids;      // [n]
  Buffer<cl_uchar> levels;  // [n - 1]
};

template <typename Key>
SortedPhotons SortPhotons(const Gpu& gpu, const Buffer<float>& positions, std::size_t count,
                          const Buffer<MortonGrid>& grid, unsigned code_bits, StageTimer& timer) {
  KeyValues<Key> codes(gpu.memory(), count);
  ComputeMortonCodes(gpu, positions, count, grid, codes);
  timer.Mark("morton");
  RadixSort(gpu, codes, count, code_bits);
  timer.Mark("sort");
  Buffer<cl_uchar> levels(gpu.memory(), count - 1);
  ComputeSplitLevels(gpu, codes.keys, count, levels);
  timer.Mark("levels");
  return {std::move(codes.values), std::move(levels)};
}

/// What all builders of the device start from.
struct BuildInput {
  const Gpu& gpu;
  const std::vector<float>& host_positions;  ///< [3n] scene units
  Buffer<float> positions;                   ///< the same
  DeviceBounds bounds;
  const BuildOptions& options;
  const CancelCheck& cancelled;
  StageTimer& timer;

  std::size_t count() const { return host_positions.size() / 3; }
};

/// Breaks the ties of sorted photons and finds their leaves.
Leaves SplitTiedPhotons(const BuildInput& in, unsigned code_bits, std::uint32_t max_leaf_size,
                        const SortedPhotons& sorted) {
  if (in.gpu.device->has_sub_groups()) {
    // Whether that was all is asked together with the number of leaves: one wait instead of two.
    const Buffer<cl_uint> is_tied = BreakShortTies(in.gpu, in.positions, in.count(), code_bits,
                                                   max_leaf_size, sorted.ids, sorted.levels);
    in.timer.Mark("ties");
    Leaves leaves = FindLeaves(in.gpu, sorted.levels, in.count(), max_leaf_size, is_tied);
    in.timer.Mark("leaves");
    if (!leaves.is_tied) return leaves;
  }
  BreakTies(in.gpu, in.positions, in.count(), code_bits, max_leaf_size, sorted.ids, sorted.levels,
            in.cancelled);
  in.timer.Mark("ties");
  Leaves leaves = FindLeaves(in.gpu, sorted.levels, in.count(), max_leaf_size);
  in.timer.Mark("leaves");
  return leaves;
}

PlacedPhotons PlaceLbvh(const BuildInput& in, std::uint32_t max_leaf_size) {
  const auto bits = static_cast<unsigned>(in.options.morton_bits);
  SortedPhotons sorted = in.options.morton_bits == MortonBits::k63
                             ? SortPhotons<cl_ulong>(in.gpu, in.positions, in.count(),
                                                     in.bounds.grid_63, bits, in.timer)
                             : SortPhotons<cl_uint>(in.gpu, in.positions, in.count(),
                                                    in.bounds.grid_30, bits, in.timer);
  Leaves leaves = SplitTiedPhotons(in, bits, max_leaf_size, sorted);
  Buffer<LeafPhoton> photons = PermutePhotons(in.gpu, in.positions, sorted.ids, in.count());
  in.timer.Mark("permute");
  ThrowIfCancelled(in.cancelled);
  return {std::move(photons), std::move(leaves), std::move(sorted.levels)};
}

/// The radius of the options, else one sampled by gathers of `tree()`, 0 where none is needed.
template <typename MakeTree>
float ResolveRadius(const BuildInput& in, const MakeTree& tree) {
  if (in.options.radius > 0 || !NeedsRadius(in.options)) return in.options.radius;
  const float radius = SampleGatherRadius(in.gpu, tree(), in.host_positions, in.options.seed);
  in.timer.Mark("radius");
  return radius;
}

/// Leaves that a sampled radius is gathered from, photons: subtrees of T are too large for it.
constexpr std::uint32_t kRadiusLeafSize = 16;

PlacedPhotons PlaceHybrid(const BuildInput& in, float& radius) {
  PlacedPhotons subtrees = PlaceLbvh(in, in.options.subtree_size);
  radius = ResolveRadius(in, [&] {
    const Leaves leaves = FindLeaves(in.gpu, subtrees.levels, in.count(), kRadiusLeafSize);
    return BuildHierarchy(in.gpu, subtrees.levels, leaves, subtrees.photons);
  });
  PlacedPhotons placed =
      SweepSubtrees(in.gpu, std::move(subtrees), in.options.subtree_size,
                    Measure(in.options.heuristic, in.bounds.ReadBox(in.gpu), radius),
                    in.options.leaf_term, in.options.max_leaf_size);
  in.timer.Mark("sweep");
  return placed;
}

PlacedPhotons PlaceTreelets(const BuildInput& in, float& radius) {
  PlacedPhotons lbvh = PlaceLbvh(in, TreeletInputLeafSize(in.options));
  const DeviceTree tree = BuildHierarchy(in.gpu, lbvh.levels, lbvh.leaves, std::move(lbvh.photons));
  in.timer.Mark("lbvh hierarchy");
  radius = ResolveRadius(in, [&] { return tree; });
  const TreeletCost cost{Measure(in.options.heuristic, in.bounds.ReadBox(in.gpu), radius),
                         in.options.leaf_term, in.options.max_leaf_size};
  PlacedPhotons placed = RestructureTreelets(in.gpu, tree, lbvh.leaves, std::move(lbvh.levels),
                                             cost, TreeletOptionsOf(in.options), in.cancelled);
  in.timer.Mark("treelets");
  return placed;
}

PlacedPhotons PlacePhotons(const BuildInput& in, float& radius) {
  switch (in.options.builder) {
    case BuilderKind::kHybrid:
      return PlaceHybrid(in, radius);
    case BuilderKind::kTreelet:
    case BuilderKind::kTrbvh:
    case BuilderKind::kAtrbvh:
      return PlaceTreelets(in, radius);
    default:
      return PlaceLbvh(in, in.options.max_leaf_size);
  }
}

/// Builds the nodes of `map` over its photons.
void BuildNodes(PlacedPhotons placed, DeviceMap& map, StageTimer& timer) {
  const Gpu& gpu = map.gpu;
  map.tree = BuildHierarchy(gpu, placed.levels, placed.leaves, std::move(placed.photons));
  timer.Mark("hierarchy");
  map.report.tree = SumStatistics(gpu, placed.leaves.leaf_count, map.report.radius, map.tree);
  timer.Mark("statistics");
  if (gpu.device->has_sub_groups()) {
    map.wide = BuildWideTree(gpu, map.tree, placed.leaves, placed.levels);
    timer.Mark("wide");
  }
  map.tree.block_flags = {};
  map.tree.climbs = {};
  map.tree.device_root = {};
}

class GpuBuilder : public Builder {
 public:
  explicit GpuBuilder(Gpu gpu) : gpu_(std::move(gpu)) {}

  std::uint64_t WorkBytes(const BuildOptions& options, std::uint64_t photon_count) const override {
    return HasDeviceStages(options) ? 0 : CpuBuildBytes(options, photon_count);
  }

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    if (const auto status = CheckBuild(photons, options); !status.ok()) return status;
    if (const auto status = CheckFits(gpu_.device->info(), photons, options); !status.ok())
      return status;
    std::optional<MeasuredCpuTree> cpu_tree;
    if (!HasDeviceStages(options)) {
      auto built = BuildMeasuredCpuTree(photons.positions, options, cancelled);
      if (!built.ok()) return built.status();
      cpu_tree = *std::move(built);
    }
    const std::lock_guard lock(gpu_.device->mutex());
    return Guard([&]() -> absl::StatusOr<std::unique_ptr<Gatherer>> {
      ThrowIfCancelled(cancelled);
      return MakeGpuGatherer(cpu_tree ? CopyMap(photons, options, *cpu_tree)
                                      : BuildMap(photons, options, cancelled));
    });
  }

 private:
  DeviceMap BuildMap(const Photons& photons, const BuildOptions& options,
                     const CancelCheck& cancelled) const {
    StageTimer timer(gpu_.queue());
    DeviceMap map = StartMap(photons, options);
    map.report.radius = options.radius;
    BuildInput in{.gpu = gpu_,
                  .host_positions = photons.positions,
                  .positions = MakeBuffer<float>(gpu_.memory(), gpu_.queue(), photons.positions),
                  .bounds = {},
                  .options = options,
                  .cancelled = cancelled,
                  .timer = timer};
    timer.Mark("upload");
    in.bounds = ComputeBounds(gpu_, in.positions, photons.size());
    timer.Mark("bounds");
    map.grid = in.bounds.grid_30;
    if (photons.size() > 0) {
      ThrowIfCancelled(cancelled);
      BuildNodes(PlacePhotons(in, map.report.radius), map, timer);
    }
    FinishMap(timer, map);
    return map;
  }

  /// The map of a tree of the host.
  DeviceMap CopyMap(const Photons& photons, const BuildOptions& options,
                    const MeasuredCpuTree& built) const {
    StageTimer timer(gpu_.queue());
    DeviceMap map = StartMap(photons, options);
    map.report.radius = built.radius;
    map.report.stages = built.stages;
    const Root& root = built.tree.root;
    const MortonGrid grid = MakeMortonGrid(
        {{root.min[0], root.min[1], root.min[2]}, {root.max[0], root.max[1], root.max[2]}}, 10);
    map.grid = MakeBuffer(gpu_.memory(), gpu_.queue(), std::span(&grid, 1));
    if (photons.size() > 0) {
      PlacedPhotons placed = PlaceTree(gpu_, built.tree);
      timer.Mark("upload");
      BuildNodes(std::move(placed), map, timer);
    }
    FinishMap(timer, map);
    return map;
  }

  /// A map of no nodes, its attributes uploaded.
  DeviceMap StartMap(const Photons& photons, const BuildOptions& options) const {
    DeviceMap map;
    map.gpu = gpu_;
    map.kind = KindOfTree(options.builder);
    map.photon_count = photons.size();
    map.has_powers = !photons.powers.empty();
    map.has_directions = !photons.directions.empty();
    map.max_leaf_size = options.max_leaf_size;
    map.report.builder = BuilderName(options);
    map.report.device = gpu_.device->info().name;
    map.powers = UploadPowers(gpu_, photons);
    map.tree.nodes = Buffer<Node>(gpu_.memory(), 0);
    map.tree.min_ids = Buffer<cl_uint>(gpu_.memory(), 0);
    map.tree.photons = Buffer<LeafPhoton>(gpu_.memory(), 0);
    return map;
  }

  static void FinishMap(StageTimer& timer, DeviceMap& map) {
    for (StageTime& stage : timer.Finish()) map.report.stages.push_back(std::move(stage));
    map.report.device_bytes = map.tree.nodes.bytes() + map.tree.min_ids.bytes() +
                              map.tree.photons.bytes() + map.wide.boxes.bytes() +
                              map.powers.bytes();
  }

  Gpu gpu_;
};

}  // namespace

std::unique_ptr<Builder> MakeGpuBuilder(Gpu gpu) {
  return std::make_unique<GpuBuilder>(std::move(gpu));
}

}  // namespace treelight
