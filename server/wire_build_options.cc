#include "server/wire_build_options.h"

#include <string>

#include "fmt/format.h"

namespace treelight::server {
namespace {

template <typename Enum>
absl::Status NoSuch(const char* field, Enum value) {
  return absl::InvalidArgumentError(
      fmt::format("options.{} is {}, no such {}", field, static_cast<int>(value), field));
}

absl::StatusOr<BuilderKind> ParseBuilder(v1::BuilderKind builder) {
  switch (builder) {
    case v1::BUILDER_KIND_UNSPECIFIED:
    case v1::BUILDER_KIND_LBVH:
      return BuilderKind::kLbvh;
    case v1::BUILDER_KIND_TREELET:
      return BuilderKind::kTreelet;
    case v1::BUILDER_KIND_AUTO:  // until it is chosen
    case v1::BUILDER_KIND_HYBRID:
      return BuilderKind::kHybrid;
    case v1::BUILDER_KIND_TRBVH:
      return BuilderKind::kTrbvh;
    case v1::BUILDER_KIND_ATRBVH:
      return BuilderKind::kAtrbvh;
    case v1::BUILDER_KIND_BALANCED:
      return BuilderKind::kBalanced;
    case v1::BUILDER_KIND_SWEEP:
      return BuilderKind::kSweep;
    case v1::BUILDER_KIND_KARRAS:
      return BuilderKind::kKarras;
    default:
      return NoSuch("builder", builder);
  }
}

v1::BuilderKind ToWire(BuilderKind builder) {
  switch (builder) {
    case BuilderKind::kLbvh:
      return v1::BUILDER_KIND_LBVH;
    case BuilderKind::kTreelet:
      return v1::BUILDER_KIND_TREELET;
    case BuilderKind::kHybrid:
      return v1::BUILDER_KIND_HYBRID;
    case BuilderKind::kTrbvh:
      return v1::BUILDER_KIND_TRBVH;
    case BuilderKind::kAtrbvh:
      return v1::BUILDER_KIND_ATRBVH;
    case BuilderKind::kBalanced:
      return v1::BUILDER_KIND_BALANCED;
    case BuilderKind::kSweep:
      return v1::BUILDER_KIND_SWEEP;
    case BuilderKind::kKarras:
      return v1::BUILDER_KIND_KARRAS;
  }
  return v1::BUILDER_KIND_UNSPECIFIED;
}

absl::StatusOr<Heuristic> ParseHeuristic(v1::Heuristic heuristic) {
  switch (heuristic) {
    case v1::HEURISTIC_SAH:
      return Heuristic::kSah;
    case v1::HEURISTIC_UNSPECIFIED:
    case v1::HEURISTIC_ISA:
      return Heuristic::kIsa;
    case v1::HEURISTIC_VVH:
      return Heuristic::kVvh;
    default:
      return NoSuch("heuristic", heuristic);
  }
}

v1::Heuristic ToWire(Heuristic heuristic) {
  switch (heuristic) {
    case Heuristic::kSah:
      return v1::HEURISTIC_SAH;
    case Heuristic::kIsa:
      return v1::HEURISTIC_ISA;
    case Heuristic::kVvh:
      return v1::HEURISTIC_VVH;
  }
  return v1::HEURISTIC_UNSPECIFIED;
}

absl::StatusOr<LeafTerm> ParseLeafTerm(v1::LeafTerm leaf_term) {
  switch (leaf_term) {
    case v1::LEAF_TERM_NONE:
      return LeafTerm::kNone;
    case v1::LEAF_TERM_UNSPECIFIED:
    case v1::LEAF_TERM_LEAF_SIZE:
      return LeafTerm::kLeafSize;
    default:
      return NoSuch("leaf_term", leaf_term);
  }
}

/// INVALID_ARGUMENT: expected_k is out of range.
absl::StatusOr<std::optional<AutoBuild>> ParseAutoBuild(const v1::BuildOptions& wire) {
  if (wire.builder() != v1::BUILDER_KIND_AUTO) return std::nullopt;
  AutoBuild automatic{.expected_gathers = wire.expected_gathers(),
                      .max_leaf_size = wire.max_leaf_size()};
  if (wire.has_expected_k()) automatic.expected_k = wire.expected_k();
  if (wire.morton_bits() != 0) automatic.morton_bits = static_cast<MortonBits>(wire.morton_bits());
  if (automatic.expected_k <= kMaxNeighbors) return automatic;
  return absl::InvalidArgumentError(
      fmt::format("options.expected_k is {}, it must be in [0, {}], 0 for gathers within a radius",
                  automatic.expected_k, kMaxNeighbors));
}

}  // namespace

absl::StatusOr<AskedBuild> ParseBuild(const v1::BuildOptions& wire) {
  const auto builder = ParseBuilder(wire.builder());
  if (!builder.ok()) return builder.status();
  const auto heuristic = ParseHeuristic(wire.heuristic());
  if (!heuristic.ok()) return heuristic.status();
  const auto leaf_term = ParseLeafTerm(wire.leaf_term());
  if (!leaf_term.ok()) return leaf_term.status();
  BuildOptions options{.builder = *builder,
                       .heuristic = *heuristic,
                       .leaf_term = *leaf_term,
                       .radius = wire.radius(),
                       .seed = wire.seed()};
  if (wire.morton_bits() != 0) options.morton_bits = static_cast<MortonBits>(wire.morton_bits());
  if (wire.max_leaf_size() != 0) options.max_leaf_size = wire.max_leaf_size();
  if (wire.treelet_size() != 0) options.treelet_size = wire.treelet_size();
  if (wire.rounds() != 0) options.rounds = wire.rounds();
  if (wire.subtree_size() != 0) options.subtree_size = wire.subtree_size();
  const auto automatic = ParseAutoBuild(wire);
  if (!automatic.ok()) return automatic.status();
  if (*automatic) options = LargestBuild(**automatic, options);
  if (const absl::Status status = CheckBuildOptions(options); !status.ok()) {
    return absl::InvalidArgumentError(
        fmt::format("options.{}, or 0 for the default", std::string(status.message())));
  }
  return AskedBuild{options, *automatic};
}

absl::StatusOr<BuildOptions> ParseBuildOptions(const v1::BuildOptions& wire) {
  auto asked = ParseBuild(wire);
  if (!asked.ok()) return asked.status();
  return asked->options;
}

v1::BuildOptions ToWire(const BuildOptions& options, const BuildReport& report) {
  const BuilderKind builder = options.builder;
  v1::BuildOptions wire;
  wire.set_builder(ToWire(builder));
  wire.set_max_leaf_size(options.max_leaf_size);
  if (ReadsMortonBits(builder))
    wire.set_morton_bits(static_cast<std::uint32_t>(options.morton_bits));
  if (ReadsHeuristic(builder)) wire.set_heuristic(ToWire(options.heuristic));
  if (ReadsLeafTerm(builder)) {
    wire.set_leaf_term(options.leaf_term == LeafTerm::kNone ? v1::LEAF_TERM_NONE
                                                            : v1::LEAF_TERM_LEAF_SIZE);
  }
  if (ReadsTreelets(builder)) {
    wire.set_treelet_size(options.treelet_size);
    wire.set_rounds(options.rounds);
  }
  if (builder == BuilderKind::kHybrid) wire.set_subtree_size(options.subtree_size);
  wire.set_radius(report.radius);
  if (options.radius == 0 && report.radius > 0) wire.set_seed(options.seed);
  return wire;
}

v1::TreeStatistics ToWire(const BuildReport& report, BuilderKind builder) {
  v1::TreeStatistics wire;
  wire.set_node_count(report.tree.node_count);
  wire.set_leaf_count(report.tree.leaf_count);
  wire.set_depth(report.tree.depth);
  wire.set_mean_leaf_depth(report.tree.mean_leaf_depth);
  wire.set_leaf_fill(report.tree.leaf_fill);
  wire.set_sah_cost(report.tree.sah_cost);
  wire.set_isa_cost(report.tree.isa_cost);
  wire.set_kind(KindOfTree(builder) == TreeKind::kBvh ? v1::TREE_KIND_BVH : v1::TREE_KIND_KD_TREE);
  return wire;
}

}  // namespace treelight::server
