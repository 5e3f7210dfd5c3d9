#include "core/cpu/cpu_builder.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/cpu/bounds.h"
#include "core/cpu/gather_radius.h"
#include "core/cpu/hybrid.h"
#include "core/cpu/lbvh.h"
#include "core/cpu/median.h"
#include "core/cpu/sliding_midpoint.h"
#include "core/cpu/sweep.h"
#include "core/cpu/tree_gatherer.h"
#include "core/cpu/treelet.h"

namespace treelight {
namespace {

using Positions = std::vector<float>;

LooseTree BuildSweep(const Positions& positions, const BuildOptions& options,
                     const Measure& measure, const Cancellation& cancellation) {
  SweepSplitter splitter(positions, measure, options.max_leaf_size, options.leaf_term,
                         cancellation);
  const PhotonRange all{0, static_cast<std::uint32_t>(positions.size() / 3), 0};
  std::vector<std::uint32_t> ids(all.count());
  for (std::uint32_t i = 0; i < all.count(); ++i) ids[i] = i;
  splitter.Begin(all, ids);
  return TopDown(options.max_leaf_size, splitter, cancellation).Build(all);
}

LooseTree BuildHybrid(const Positions& positions, const BuildOptions& options,
                      const Measure& measure, const Cancellation& cancellation) {
  LbvhSplitter lbvh(positions, options.morton_bits, MortonLayout::kCubic, options.subtree_size,
                    cancellation);
  HybridSplitter splitter(lbvh, positions, measure, options.max_leaf_size, options.leaf_term,
                          options.subtree_size);
  return TopDown(options.max_leaf_size, splitter, cancellation).Build(splitter.Root());
}

LooseTree BuildBalanced(const Positions& positions, const BuildOptions& options,
                        const Cancellation& cancellation) {
  MedianSplitter splitter(positions, options.max_leaf_size, options.leaf_term);
  return TopDown(options.max_leaf_size, splitter, cancellation)
      .Build({0, static_cast<std::uint32_t>(positions.size() / 3), 0});
}

LooseTree BuildSlidingMidpoint(const Positions& positions, const BuildOptions& options,
                               const Cancellation& cancellation) {
  SlidingMidpointSplitter splitter(positions, options.max_leaf_size);
  return TopDown(options.max_leaf_size, splitter, cancellation)
      .Build(splitter.Root(static_cast<std::uint32_t>(positions.size() / 3)));
}

LooseTree BuildTreelets(const Positions& positions, const BuildOptions& options,
                        const Measure& measure, const Cancellation& cancellation) {
  LooseTree tree = BuildLbvh(positions, options.morton_bits, MortonLayout::kCubic,
                             TreeletInputLeafSize(options), cancellation);
  if (cancellation.stopped()) return tree;
  RestructureTreelets(tree, {measure, options.leaf_term, options.max_leaf_size},
                      TreeletOptionsOf(options), cancellation);
  return tree;
}

/// A tree for a few searches: quickly made, with large leaves.
Tree SampleTree(const std::vector<float>& positions, const Cancellation& cancellation) {
  constexpr std::uint32_t kLeafSize = 1024;
  if (positions.empty()) return {};
  const LooseTree loose =
      BuildLbvh(positions, MortonBits::k30, MortonLayout::kCubic, kLeafSize, cancellation);
  return cancellation.stopped() ? Tree() : Arrange(loose, TreeKind::kKdTree, kLeafSize);
}

class CpuBuilder : public Builder {
 public:
  explicit CpuBuilder(std::string device_name) : device_name_(std::move(device_name)) {}

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    if (const auto status = CheckBuild(photons, options); !status.ok()) return status;
    auto built = BuildMeasuredCpuTree(photons.positions, options, cancelled);
    if (!built.ok()) return built.status();
    BuildReport report;
    report.builder = BuilderName(options);
    report.device = device_name_;
    report.radius = built->radius;
    report.stages = std::move(built->stages);
    return MakeTreeGatherer(photons, std::move(built->tree), std::move(report));
  }

  std::uint64_t WorkBytes(const BuildOptions& options, std::uint64_t photon_count) const override {
    return CpuBuildBytes(options, photon_count);
  }

 private:
  const std::string device_name_;
};

}  // namespace

std::uint32_t TreeletInputLeafSize(const BuildOptions& options) {
  return options.leaf_term == LeafTerm::kLeafSize ? std::max(options.max_leaf_size / 4, 1u)
                                                  : options.max_leaf_size;
}

TreeletOptions TreeletOptionsOf(const BuildOptions& options) {
  const auto method = options.builder == BuilderKind::kTreelet ? TreeletMethod::kKdTree
                      : options.builder == BuilderKind::kTrbvh ? TreeletMethod::kBvh
                                                               : TreeletMethod::kAgglomerative;
  return {method, options.treelet_size, options.rounds};
}

bool NeedsRadius(const BuildOptions& options) {
  return ReadsHeuristic(options.builder) && options.heuristic != Heuristic::kSah;
}

std::uint64_t CpuBuildBytes(const BuildOptions& options, std::uint64_t photon_count) {
  // A pair of subtrees for each boundary between photons, the photons three times, their ids in
  // three orders, and the tree itself.
  constexpr std::uint64_t kPhotonBytes = 104 + 3 * sizeof(LeafPhoton) + 24;
  return photon_count * (kPhotonBytes + 2 * sizeof(Node) / options.max_leaf_size);
}

Tree BuildCpuTree(const std::vector<float>& positions, const BuildOptions& options, float radius,
                  const Cancellation& cancellation) {
  const auto build = [&]() -> LooseTree {
    if (positions.empty()) return {};
    const auto measure = [&] { return Measure(options.heuristic, BoundsOf(positions), radius); };
    switch (options.builder) {
      case BuilderKind::kLbvh:
        return BuildLbvh(positions, options.morton_bits, MortonLayout::kCubic,
                         options.max_leaf_size, cancellation);
      case BuilderKind::kTreelet:
      case BuilderKind::kTrbvh:
      case BuilderKind::kAtrbvh:
        return BuildTreelets(positions, options, measure(), cancellation);
      case BuilderKind::kHybrid:
        return BuildHybrid(positions, options, measure(), cancellation);
      case BuilderKind::kBalanced:
        return BuildBalanced(positions, options, cancellation);
      case BuilderKind::kSlidingMidpoint:
        return BuildSlidingMidpoint(positions, options, cancellation);
      case BuilderKind::kSweep:
        return BuildSweep(positions, options, measure(), cancellation);
      case BuilderKind::kKarras:
        return BuildLbvh(positions, options.morton_bits, MortonLayout::kPerAxis,
                         options.max_leaf_size, cancellation);
    }
    return {};
  };
  const LooseTree loose = build();
  if (cancellation.Ask()) return {};
  return Arrange(loose, KindOfTree(options.builder), options.max_leaf_size);
}

absl::StatusOr<MeasuredCpuTree> BuildMeasuredCpuTree(const std::vector<float>& positions,
                                                     const BuildOptions& options,
                                                     const CancelCheck& cancelled) {
  const Cancellation cancellation(cancelled);
  MeasuredCpuTree built;
  built.radius = options.radius;
  auto start = std::chrono::steady_clock::now();
  const auto mark = [&](const char* stage) {
    const auto now = std::chrono::steady_clock::now();
    built.stages.push_back({stage, std::chrono::duration<double, std::micro>(now - start).count()});
    start = now;
  };
  if (options.radius == 0 && NeedsRadius(options)) {
    built.radius = SampleGatherRadius(SampleTree(positions, cancellation), positions, options.seed);
    mark("radius");
  }
  if (cancellation.Ask()) return absl::CancelledError("build cancelled");
  built.tree = BuildCpuTree(positions, options, built.radius, cancellation);
  mark("tree");
  if (cancellation.Ask()) return absl::CancelledError("build cancelled");
  return built;
}

std::unique_ptr<Builder> MakeCpuBuilder(std::string device_name) {
  return std::make_unique<CpuBuilder>(std::move(device_name));
}

}  // namespace treelight
