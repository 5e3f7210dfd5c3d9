#include "core/gatherer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string_view>

#include "absl/status/status.h"
#include "core/model/first_beyond.h"
#include "fmt/format.h"

namespace treelight {
namespace {

constexpr std::uint32_t kAllOutputs = kOutputCount | kOutputRadius | kOutputNeighbors |
                                      kOutputDensity | kOutputStatistics | kOutputErrorBound;

absl::Status CheckPositions(std::span<const float> positions) {
  if (positions.size() % 3 != 0) {
    return absl::InvalidArgumentError(
        fmt::format("positions: {} numbers are no multiple of 3", positions.size()));
  }
  const std::size_t i = FirstBeyond(positions, kMaxCoordinate);
  if (i == positions.size()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("positions[{}] of query {} is {}, it must be finite and within {:g}", i, i / 3,
                  positions[i], kMaxCoordinate));
}

absl::Status CheckRadii(const GatherQueries& queries, const GatherOptions& options) {
  if (!queries.radii.empty() && queries.radii.size() != queries.size()) {
    return absl::InvalidArgumentError(
        fmt::format("radii: {} numbers for {} queries", queries.radii.size(), queries.size()));
  }
  const auto check = [&](float radius, const std::string& name) -> absl::Status {
    if (!(radius >= 0))
      return absl::InvalidArgumentError(fmt::format("{} is {}, it must be >= 0", name, radius));
    if (options.k == 0 && std::isinf(radius)) {
      return absl::InvalidArgumentError(
          fmt::format("k is 0 and {} is unlimited: give k > 0 or a finite radius", name));
    }
    return absl::OkStatus();
  };
  if (queries.radii.empty()) return check(options.radius, "radius");
  for (std::size_t i = 0; i < queries.radii.size(); ++i) {
    if (!(queries.radii[i] >= 0) || (options.k == 0 && std::isinf(queries.radii[i]))) {
      return check(queries.radii[i], fmt::format("radii[{}]", i));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckNormals(const Gatherer& map, const GatherQueries& queries) {
  if (queries.normals.empty()) return absl::OkStatus();
  if (queries.normals.size() != queries.positions.size()) {
    return absl::InvalidArgumentError(
        fmt::format("normals: {} numbers for {} queries", queries.normals.size(), queries.size()));
  }
  if (!map.has_directions()) {
    return absl::InvalidArgumentError(
        "normals: the map has no directions; build it with directions or leave them out");
  }
  const std::size_t i = FirstBeyond(queries.normals, std::numeric_limits<float>::max());
  if (i == queries.normals.size()) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("normals[{}] of query {} is {}, it must be finite",
                                                i, i / 3, queries.normals[i]));
}

/// Photons that one may stand for.
absl::Status CheckGroupSize(std::string_view field, std::uint32_t size) {
  if (size == 0 || (size >= 2 && size <= kMaxMergedPhotons && std::has_single_bit(size))) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      fmt::format("approximation.{} is {}, it must be 0 or a power of two in [2, {}]", field, size,
                  kMaxMergedPhotons));
}

/// Of what may be gathered from fewer photons.
absl::Status CheckMerges(const GatherOptions& options) {
  const Approximation& approximation = options.approximation;
  const float error = approximation.max_relative_error;
  const std::uint32_t merged = approximation.merged_photons;
  const std::uint32_t thinned = approximation.thinned_photons;
  if (!(error >= 0 && error < 1)) {
    return absl::InvalidArgumentError(
        fmt::format("approximation.max_relative_error is {}, it must be in [0, 1)", error));
  }
  for (const absl::Status& status :
       {CheckGroupSize("merged_photons", merged), CheckGroupSize("thinned_photons", thinned)}) {
    if (!status.ok()) return status;
  }
  if (!approximation.merges()) return absl::OkStatus();
  const std::string asked = error > 0 ? fmt::format("approximation.max_relative_error is {}", error)
                            : merged > 0
                                ? fmt::format("approximation.merged_photons is {}", merged)
                                : fmt::format("approximation.thinned_photons is {}", thinned);
  const int asked_count = (error > 0 ? 1 : 0) + (merged > 0 ? 1 : 0) + (thinned > 0 ? 1 : 0);
  if (approximation.any() || asked_count > 1) {
    return absl::InvalidArgumentError(
        fmt::format("{}, which goes with no other field of approximation", asked));
  }
  constexpr std::uint32_t kMergedOutputs = kOutputCount | kOutputRadius | kOutputDensity;
  if ((options.outputs & kOutputDensity) == 0 || (options.outputs & ~kMergedOutputs) != 0) {
    return absl::InvalidArgumentError(
        fmt::format("{}, but outputs is {}: it is for DENSITY, with COUNT and RADIUS beside it",
                    asked, options.outputs));
  }
  return absl::OkStatus();
}

absl::Status CheckApproximation(const GatherOptions& options, bool has_normals) {
  if (auto status = CheckMerges(options); !status.ok()) return status;
  const Approximation& approximation = options.approximation;
  if (!(approximation.epsilon >= 0) || std::isinf(approximation.epsilon)) {
    return absl::InvalidArgumentError(fmt::format(
        "approximation.epsilon is {}, it must be finite and >= 0", approximation.epsilon));
  }
  if ((options.outputs & kOutputErrorBound) != 0 && !approximation.any()) {
    return absl::InvalidArgumentError(
        "outputs: ERROR_BOUND is for approximate answers; set a field of approximation");
  }
  if (!(approximation.weight_tolerance >= 0 && approximation.weight_tolerance <= 1)) {
    return absl::InvalidArgumentError(
        fmt::format("approximation.weight_tolerance is {}, it must be in [0, 1]",
                    approximation.weight_tolerance));
  }
  if (approximation.weight_tolerance > 0) {
    const auto refused = [&](std::string_view why) {
      return absl::InvalidArgumentError(fmt::format("approximation.weight_tolerance is {}, but {}",
                                                    approximation.weight_tolerance, why));
    };
    if (options.k > 0) return refused("k is not 0: it is for all photons within a radius");
    if ((options.outputs & kOutputDensity) == 0) return refused("DENSITY is not among the outputs");
    if (has_normals) return refused("there are normals, which judge photons one by one");
  }
  if (options.k > 0 || (approximation.epsilon == 0 && approximation.max_leaves == 0)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(fmt::format(
      "approximation.{}, but k is 0: it is for the k nearest, give k > 0",
      approximation.epsilon > 0 ? fmt::format("epsilon is {}", approximation.epsilon)
                                : fmt::format("max_leaves is {}", approximation.max_leaves)));
}

}  // namespace

float Approximation::squared_stretch() const {
  const double stretch = 1 + double{epsilon};
  return std::max(1.0f, std::nextafter(static_cast<float>(stretch * stretch), 0.0f));
}

float NearestErrorBound(bool full, float farthest, float given_up) {
  constexpr float kNone = std::numeric_limits<float>::infinity();
  if (!full) return given_up < kNone ? kNone : 0;
  if (!(given_up < farthest)) return 0;
  // Above the roundings of the quotient and the root.
  return std::sqrt(farthest / given_up) * (1 + 0x1p-22f) - 1;
}

absl::Status CheckGather(const Gatherer& map, const GatherQueries& queries,
                         const GatherOptions& options) {
  if (options.outputs == 0 || (options.outputs & ~kAllOutputs) != 0) {
    return absl::InvalidArgumentError(
        fmt::format("outputs is {}, it must be a sum of known outputs and not 0", options.outputs));
  }
  if (options.k > kMaxNeighbors) {
    return absl::InvalidArgumentError(
        fmt::format("k is {}, at most {} is possible", options.k, kMaxNeighbors));
  }
  if ((options.outputs & kOutputDensity) != 0 && !map.has_powers() && map.photon_count() > 0) {
    return absl::InvalidArgumentError("outputs: DENSITY needs powers; the map has none");
  }
  if (options.kernel > DensityKernel::kEpanechnikov) {
    return absl::InvalidArgumentError(
        fmt::format("kernel is {}, no such kernel", static_cast<std::uint32_t>(options.kernel)));
  }
  for (const absl::Status& status :
       {CheckPositions(queries.positions), CheckRadii(queries, options), CheckNormals(map, queries),
        CheckApproximation(options, !queries.normals.empty())}) {
    if (!status.ok()) return status;
  }
  const bool lists = (options.outputs & kOutputNeighbors) != 0;
  return CheckNeighborCount(lists ? std::uint64_t{options.k} * queries.size() : 0, options);
}

absl::Status CheckNeighborCount(std::uint64_t neighbor_count, const GatherOptions& options) {
  if (neighbor_count <= options.max_neighbors) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      fmt::format("the answer of the batch holds {} neighbours, the limit is {} (max_neighbors); "
                  "send fewer queries in "
                  "a batch, or a smaller k or radius",
                  neighbor_count, options.max_neighbors));
}

}  // namespace treelight
