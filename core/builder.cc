#include "core/builder.h"

#include <limits>

#include "absl/status/status.h"
#include "core/model/first_beyond.h"
#include "fmt/format.h"

namespace treelight {
namespace {

absl::Status CheckLength(const char* field, std::size_t length, std::size_t expected) {
  if (length == 0 || length == expected) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}: {} numbers, expected {} or none", field, length, expected));
}

absl::Status CheckRange(const char* field, std::uint32_t value, std::uint32_t low,
                        std::uint32_t high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} is {}, it must be in [{}, {}]", field, value, low, high));
}

std::uint32_t LargestTreelet(BuilderKind builder) {
  switch (builder) {
    case BuilderKind::kTrbvh:
      return 9;
    case BuilderKind::kAtrbvh:
      return 32;
    default:
      return 16;
  }
}

}  // namespace

std::uint64_t Builder::WorkBytes(const BuildOptions&, std::uint64_t) const { return 0; }

std::string BuilderName(const BuildOptions& options) {
  switch (options.builder) {
    case BuilderKind::kLbvh:
      return "lbvh";
    case BuilderKind::kTreelet:
      return "treelet";
    case BuilderKind::kHybrid:
      return "hybrid";
    case BuilderKind::kTrbvh:
      return "trbvh";
    case BuilderKind::kAtrbvh:
      return "atrbvh";
    case BuilderKind::kBalanced:
      return "balanced";
    case BuilderKind::kSweep:
      return HeuristicName(options.heuristic);
    case BuilderKind::kKarras:
      return "karras";
  }
  return "unknown";
}

std::string HeuristicName(Heuristic heuristic) {
  switch (heuristic) {
    case Heuristic::kSah:
      return "sah";
    case Heuristic::kIsa:
      return "isa";
    case Heuristic::kVvh:
      return "vvh";
  }
  return "unknown";
}

TreeKind KindOfTree(BuilderKind builder) {
  const bool overlaps = builder == BuilderKind::kTrbvh || builder == BuilderKind::kAtrbvh ||
                        builder == BuilderKind::kKarras;
  return overlaps ? TreeKind::kBvh : TreeKind::kKdTree;
}

bool ReadsTreelets(BuilderKind builder) {
  return builder == BuilderKind::kTreelet || builder == BuilderKind::kTrbvh ||
         builder == BuilderKind::kAtrbvh;
}

bool ReadsMortonBits(BuilderKind builder) {
  return builder != BuilderKind::kBalanced && builder != BuilderKind::kSweep;
}

bool ReadsLeafTerm(BuilderKind builder) {
  return ReadsHeuristic(builder) || builder == BuilderKind::kBalanced;
}

bool ReadsHeuristic(BuilderKind builder) {
  return ReadsTreelets(builder) || builder == BuilderKind::kHybrid ||
         builder == BuilderKind::kSweep;
}

bool HasDeviceStages(const BuildOptions& options) {
  switch (options.builder) {
    case BuilderKind::kLbvh:
      return true;
    case BuilderKind::kHybrid:
      return options.subtree_size <= MaxDeviceSubtree(options.max_leaf_size);
    case BuilderKind::kTreelet:
    case BuilderKind::kTrbvh:
      return options.treelet_size <= kMaxSearchedTreelet;
    case BuilderKind::kAtrbvh:
      return options.treelet_size <= kMaxDeviceAgglomeration;
    default:
      return false;
  }
}

absl::Status CheckBuildOptions(const BuildOptions& options) {
  if (auto status = CheckRange("max_leaf_size", options.max_leaf_size, 1, kMaxLeafSize);
      !status.ok()) {
    return status;
  }
  if (options.morton_bits != MortonBits::k30 && options.morton_bits != MortonBits::k63) {
    return absl::InvalidArgumentError(fmt::format("morton_bits is {}, it must be 30 or 63",
                                                  static_cast<std::uint32_t>(options.morton_bits)));
  }
  if (ReadsTreelets(options.builder)) {
    for (const absl::Status& status :
         {CheckRange("treelet_size", options.treelet_size, 3, LargestTreelet(options.builder)),
          CheckRange("rounds", options.rounds, 1, kMaxRounds)}) {
      if (!status.ok()) return status;
    }
  }
  if (!(options.radius >= 0 && options.radius <= kMaxCoordinate)) {  // also catches NaN
    return absl::InvalidArgumentError(
        fmt::format("radius is {}, it must be in [0, {:g}]", options.radius, kMaxCoordinate));
  }
  if (options.builder == BuilderKind::kHybrid) {
    return CheckRange("subtree_size", options.subtree_size, options.max_leaf_size, kMaxSubtreeSize);
  }
  return absl::OkStatus();
}

absl::Status CheckBuild(const Photons& photons, const BuildOptions& options) {
  if (photons.positions.size() % 3 != 0) {
    return absl::InvalidArgumentError(
        fmt::format("positions: {} numbers are no multiple of 3", photons.positions.size()));
  }
  for (const absl::Status& status :
       {CheckLength("powers", photons.powers.size(), 3 * photons.size()),
        CheckLength("directions", photons.directions.size(), 2 * photons.size())}) {
    if (!status.ok()) return status;
  }
  if (photons.size() >= kLeafBit) {
    return absl::ResourceExhaustedError(
        fmt::format("photons: {}, a map holds at most {}", photons.size(), kLeafBit - 1));
  }
  if (const std::size_t i = FirstBeyond(photons.positions, kMaxCoordinate);
      i < photons.positions.size()) {
    return absl::InvalidArgumentError(
        fmt::format("positions[{}] of photon {} is {}, it must be finite and within {:g}", i, i / 3,
                    photons.positions[i], kMaxCoordinate));
  }
  if (const std::size_t i = FirstBeyond(photons.powers, std::numeric_limits<float>::max());
      i < photons.powers.size()) {
    return absl::InvalidArgumentError(fmt::format(
        "powers[{}] of photon {} is {}, it must be finite", i, i / 3, photons.powers[i]));
  }
  return CheckBuildOptions(options);
}

}  // namespace treelight
