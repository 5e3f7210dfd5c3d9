#include "core/cpu/cpu_builder.h"

#include <algorithm>
#include <utility>

#include "core/cpu/bounds.h"
#include "core/cpu/clock.h"
#include "core/cpu/gather_radius.h"
#include "core/cpu/hybrid.h"
#include "core/cpu/lbvh.h"
#include "core/cpu/median.h"
#include "core/cpu/sweep.h"
#include "core/cpu/tree_gatherer.h"
#include "core/cpu/treelet.h"

namespace treelight {
namespace {

using Positions = std::vector<float>;

/// One build: what it is asked for, and what it has found out.
class CpuBuild {
 public:
  CpuBuild(const Positions& positions, const BuildOptions& options,
           const Cancellation& cancellation)
      : positions_(positions),
        options_(options),
        cancellation_(cancellation),
        radius_(options.radius) {}

  /// Of one that was cancelled there are parts, which nobody may look at.
  LooseTree Run() {
    if (positions_.empty()) return {};
    switch (options_.builder) {
      case BuilderKind::kLbvh:
        return Lbvh(MortonLayout::kCubic, options_.max_leaf_size);
      case BuilderKind::kTreelet:
      case BuilderKind::kTrbvh:
      case BuilderKind::kAtrbvh:
        return Treelets();
      case BuilderKind::kHybrid:
        return Hybrid();
      case BuilderKind::kBalanced: {
        MedianSplitter splitter(positions_, options_.max_leaf_size, options_.leaf_term);
        return Split(splitter, {0, count(), 0});
      }
      case BuilderKind::kSweep:
        return Sweep();
      case BuilderKind::kKarras:
        return Lbvh(MortonLayout::kPerAxis, options_.max_leaf_size);
    }
    return {};
  }

  float radius() const { return radius_; }
  double radius_us() const { return radius_us_; }  ///< time of its sampling; 0: it was not sampled

 private:
  std::uint32_t count() const { return static_cast<std::uint32_t>(positions_.size() / 3); }

  template <typename Splitter>
  LooseTree Split(Splitter& splitter, const typename Splitter::Range& root) const {
    return TopDown(options_.max_leaf_size, splitter, cancellation_).Build(root);
  }

  LooseTree Lbvh(MortonLayout layout, std::uint32_t max_leaf_size) const {
    return BuildLbvh(positions_, options_.morton_bits, layout, max_leaf_size, cancellation_);
  }

  LooseTree Hybrid() {
    LbvhSplitter lbvh(positions_, options_.morton_bits, MortonLayout::kCubic, options_.subtree_size,
                      cancellation_);
    const LooseTree upper = TopDown(options_.subtree_size, lbvh, cancellation_).Build(lbvh.Root());
    if (cancellation_.stopped()) return {};
    SampleRadius([&]() -> const LooseTree& { return upper; });
    HybridSplitter splitter(lbvh, upper, MeasureOfCosts(), options_.max_leaf_size,
                            options_.leaf_term);
    return Split(splitter, splitter.Root());
  }

  LooseTree Treelets() {
    LooseTree tree = Lbvh(MortonLayout::kCubic, TreeletInputLeafSize(options_));
    if (cancellation_.stopped()) return tree;
    SampleRadius([&]() -> const LooseTree& { return tree; });
    RestructureTreelets(tree, {MeasureOfCosts(), options_.leaf_term, options_.max_leaf_size},
                        TreeletOptionsOf(options_), cancellation_);
    return tree;
  }

  LooseTree Sweep() {
    constexpr std::uint32_t kSampledLeafSize = 256;
    SampleRadius([&] { return Lbvh(MortonLayout::kCubic, kSampledLeafSize); });
    if (cancellation_.stopped()) return {};
    SweepSplitter splitter(MeasureOfCosts(), options_.max_leaf_size, options_.leaf_term,
                           cancellation_);
    const PhotonRange all{0, count(), 0};
    splitter.Begin(all, AllPhotons(positions_));
    return Split(splitter, all);
  }

  /// Samples the radius in the tree that `make_tree` gives, where it is needed and not given.
  template <typename MakeTree>
  void SampleRadius(const MakeTree& make_tree) {
    if (radius_ > 0 || !NeedsRadius(options_)) return;
    const auto start = Clock::now();
    const auto& tree = make_tree();
    if (!cancellation_.stopped()) radius_ = SampleGatherRadius(tree, positions_, options_.seed);
    radius_us_ = MicrosecondsSince(start);
  }

  Measure MeasureOfCosts() const {
    return Measure(options_.heuristic, BoundsOf(positions_), radius_);
  }

  const Positions& positions_;
  const BuildOptions& options_;
  const Cancellation& cancellation_;
  float radius_;
  double radius_us_ = 0;
};

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
    return MakeTreeGatherer(
        {.positions = {}, .powers = photons.powers, .directions = photons.directions},
        std::move(built->tree), std::move(report));
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

absl::StatusOr<MeasuredCpuTree> BuildMeasuredCpuTree(const std::vector<float>& positions,
                                                     const BuildOptions& options,
                                                     const CancelCheck& cancelled) {
  const Cancellation cancellation(cancelled);
  const auto start = Clock::now();
  CpuBuild build(positions, options, cancellation);
  const LooseTree loose = build.Run();
  if (cancellation.Ask()) return absl::CancelledError("build cancelled");
  MeasuredCpuTree built;
  built.tree = Arrange(loose, KindOfTree(options.builder), options.max_leaf_size);
  built.radius = build.radius();
  const double sampled_us = build.radius_us();
  if (sampled_us > 0) built.stages.push_back({"radius", sampled_us});
  built.stages.push_back({"tree", MicrosecondsSince(start) - sampled_us});
  return built;
}

std::unique_ptr<Builder> MakeCpuBuilder(std::string device_name) {
  return std::make_unique<CpuBuilder>(std::move(device_name));
}

}  // namespace treelight
