#include "core/build_chooser.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/cost_meter.h"
#include "core/cpu/bounds.h"
#include "core/model/morton.h"
#include "fmt/format.h"

namespace treelight {
namespace {

/// The k that stands for `k`: the power of two above it, at least 8.
std::uint32_t MeasuredK(std::uint32_t k) {
  return k == 0 ? 0 : std::clamp(std::bit_ceil(k), 8u, kMaxNeighbors);
}

/// Part of the sorted `codes` that come in runs of at least `many`.
double PartInRuns(const std::vector<std::uint64_t>& codes, std::size_t many) {
  std::size_t in_runs = 0;
  for (auto run = codes.begin(); run != codes.end();) {
    const auto end = std::find_if(run, codes.end(), [&](auto code) { return code != *run; });
    const auto length = static_cast<std::size_t>(end - run);
    if (length >= many) in_runs += length;
    run = end;
  }
  return static_cast<double>(in_runs) / static_cast<double>(codes.size());
}

std::size_t NearestCandidate(BuilderKind builder, std::uint32_t max_leaf_size) {
  std::size_t nearest = 0;
  std::uint32_t least = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t i = 0; i < kTreeCandidates.size(); ++i) {
    const TreeCandidate& candidate = kTreeCandidates[i];
    if (candidate.builder != builder) continue;
    const std::uint32_t distance = std::max(candidate.max_leaf_size, max_leaf_size) -
                                   std::min(candidate.max_leaf_size, max_leaf_size);
    if (distance >= least) continue;
    nearest = i;
    least = distance;
  }
  return nearest;
}

/// `us` with the unit that people would take.
std::string Readable(double us) {
  return us < 1e3   ? fmt::format("{:.0f} us", us)
         : us < 1e6 ? fmt::format("{:.3g} ms", us / 1e3)
                    : fmt::format("{:.3g} s", us / 1e6);
}

}  // namespace

SharedCells CountSharedCells(const std::vector<float>& positions, std::uint32_t max_leaf_size) {
  constexpr std::size_t kSample = 1 << 14;
  const std::size_t count = positions.size() / 3, sampled = std::min(count, kSample);
  if (count == 0) return {};
  // Of a cell with four leaves of photons, what the sample has; one photon alone shares nothing.
  const double leaves =
      4.0 * max_leaf_size * static_cast<double>(sampled) / static_cast<double>(count);
  const auto many = std::max<std::size_t>(4, static_cast<std::size_t>(std::ceil(leaves)));
  const Box bounds = BoundsOf(positions);
  const auto part = [&](unsigned bits_per_axis) {
    const MortonGrid grid = MakeMortonGrid(bounds, bits_per_axis);
    std::vector<std::uint64_t> codes(sampled);
    for (std::size_t i = 0; i < sampled; ++i) {
      const float* const p = &positions[3 * (i * count / sampled)];
      codes[i] = MortonCode({p[0], p[1], p[2]}, grid, bits_per_axis);
    }
    std::ranges::sort(codes);
    return PartInRuns(codes, many);
  };
  return {.of_30_bits = part(10), .of_63_bits = part(21)};
}

BuildChoice ChooseBuild(const BuildCosts& costs, const SharedCells& shared,
                        std::uint64_t photon_count, const AutoBuild& asked, BuildOptions options) {
  const auto photons = static_cast<double>(photon_count);
  const auto gathers =
      static_cast<double>(asked.expected_gathers > 0 ? asked.expected_gathers : photon_count);
  const double short_us = photons * shared.of_30_bits * costs.shared_cell_us;
  const double long_us = photons * (costs.long_code_us + shared.of_63_bits * costs.shared_cell_us);
  options.morton_bits =
      asked.morton_bits.value_or(long_us < short_us ? MortonBits::k63 : MortonBits::k30);
  const double code_us = options.morton_bits == MortonBits::k63 ? long_us : short_us;

  struct Sum {
    TreeCandidate tree;
    double build_us = 0, gathers_us = 0;
    double total_us() const { return build_us + gathers_us; }
  };
  std::vector<Sum> sums;
  for (std::size_t i = 0; i < kTreeCandidates.size(); ++i) {
    TreeCandidate tree = kTreeCandidates[i];
    if (asked.max_leaf_size > 0) {
      if (NearestCandidate(tree.builder, asked.max_leaf_size) != i) continue;
      tree.max_leaf_size = asked.max_leaf_size;
    }
    const TreeCosts& cost = costs.trees[i];
    sums.push_back({.tree = tree,
                    .build_us = cost.build_us + photons * cost.photon_us + code_us,
                    .gathers_us = gathers * cost.gather_us});
  }
  std::ranges::stable_sort(sums, {}, &Sum::total_us);
  const Sum& best = sums.front();
  options.builder = best.tree.builder;
  options.max_leaf_size = best.tree.max_leaf_size;
  options.subtree_size = kCandidateSubtree;
  // Beside it, the best tree that differs by more than its leaves.
  const auto other = std::ranges::find_if(
      sums, [&](const Sum& sum) { return sum.tree.builder != best.tree.builder; });
  const auto describe = [](const Sum& sum) {
    return fmt::format("{} with leaves of {} takes {} to build and {}",
                       BuilderName({.builder = sum.tree.builder}), sum.tree.max_leaf_size,
                       Readable(sum.build_us), Readable(sum.gathers_us));
  };
  return {options,
          fmt::format("{} for {:.3g} gathers of {}, {}, by this device's times; {:.0f} % of the "
                      "photons share a cell of 30-bit codes, {:.0f} % one of 63",
                      describe(best), gathers,
                      asked.expected_k > 0 ? fmt::format("k {}", asked.expected_k) : "a radius",
                      describe(*other), 100 * shared.of_30_bits, 100 * shared.of_63_bits)};
}

BuildOptions LargestBuild(const AutoBuild& asked, BuildOptions options) {
  options.builder = BuilderKind::kHybrid;
  options.max_leaf_size = kTreeCandidates.front().max_leaf_size;
  if (asked.max_leaf_size > 0) options.max_leaf_size = asked.max_leaf_size;
  options.subtree_size = kCandidateSubtree;
  options.morton_bits = asked.morton_bits.value_or(MortonBits::k63);
  return options;
}

std::uint64_t BuildChooser::WorkBytes(const AutoBuild& asked) const {
  return costs_.contains(MeasuredK(asked.expected_k)) ? 0 : kMeasureBytes;
}

absl::StatusOr<BuildChoice> BuildChooser::Choose(const Photons& photons, const AutoBuild& asked,
                                                 const BuildOptions& options,
                                                 const CancelCheck& cancelled) {
  const std::uint32_t k = MeasuredK(asked.expected_k);
  const auto costs = costs_.Find(k, [&] { return MeasureBuildCosts(builder_, k, cancelled); });
  if (!costs.ok()) return costs.status();
  const std::uint32_t leaf_size =
      asked.max_leaf_size > 0 ? asked.max_leaf_size : kTreeCandidates.front().max_leaf_size;
  return ChooseBuild(*costs, CountSharedCells(photons.positions, leaf_size), photons.size(), asked,
                     options);
}

}  // namespace treelight
