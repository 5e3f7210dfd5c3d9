#include "client/bench/bench_plan.h"

#include <algorithm>
#include <optional>

#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::uint32_t kLists = kOutputCount | kOutputNeighbors;
// The largest k that is asked for within r1, which holds 75 photons.
constexpr std::uint32_t kLargestKInR1 = 100;

/// The inverse of BuilderName.
std::optional<BuildOptions> OptionsNamed(const std::string& name) {
  for (const BuilderKind builder :
       {BuilderKind::kLbvh, BuilderKind::kTreelet, BuilderKind::kHybrid, BuilderKind::kTrbvh,
        BuilderKind::kAtrbvh, BuilderKind::kBalanced, BuilderKind::kSweep, BuilderKind::kKarras}) {
    for (const Heuristic heuristic : {Heuristic::kIsa, Heuristic::kSah, Heuristic::kVvh}) {
      const BuildOptions options{.builder = builder, .heuristic = heuristic};
      if (BuilderName(options) == name) return options;
    }
  }
  return std::nullopt;
}

BenchSearch Nearest(std::uint32_t k, bool in_r1, bool sorted) {
  return {.name = fmt::format("k {}{}", k, in_r1 ? " in r1" : ""),
          .k = k,
          .in_r1 = in_r1,
          .outputs = kLists,
          .sorted = sorted};
}

BenchSearch Density(bool sorted) {
  return {.name = "density of 50 in r1",
          .k = 50,
          .in_r1 = true,
          .outputs = kOutputDensity,
          .sorted = sorted};
}

BenchSearch CountInR1(bool sorted) {
  return {.name = "count in r1", .k = 0, .in_r1 = true, .outputs = kOutputCount, .sorted = sorted};
}

std::vector<BenchSearch> StandardSearches() {
  std::vector<BenchSearch> searches;
  for (const bool sorted : {false, true}) {
    for (const std::uint32_t k : {8u, 50u, 100u}) searches.push_back(Nearest(k, false, sorted));
    searches.push_back(Nearest(50, true, sorted));
    searches.push_back(Density(sorted));
    searches.push_back(CountInR1(sorted));
  }
  return searches;
}

/// Adds gathers of each k that are not there.
void AddKs(const std::vector<std::uint32_t>& ks, std::vector<BenchSearch>& searches) {
  for (const bool in_r1 : {false, true}) {
    for (const std::uint32_t k : ks) {
      if (in_r1 && k > kLargestKInR1) continue;
      const BenchSearch search = Nearest(k, in_r1, false);
      const bool there = std::ranges::any_of(searches, [&](const BenchSearch& other) {
        return other.name == search.name && !other.sorted;
      });
      if (!there) searches.push_back(search);
    }
  }
}

}  // namespace

BenchPlan QuickBenchPlan() {
  BenchPlan plan;
  plan.sets = {PointSet::kSurfaces};
  plan.photons = {10'000, 100'000};
  plan.detail_photons = 100'000;
  plan.leaf_sizes = {16};
  plan.ks = {1, 8, 50, 128};
  plan.queries = 10'000;
  plan.repetitions = 3;
  return plan;
}

absl::StatusOr<std::vector<BenchCell>> MakeCells(const BenchPlan& plan) {
  std::vector<BenchSubject> subjects;
  for (const std::string& builder : plan.builders) {
    for (const std::uint32_t leaf_size : plan.leaf_sizes) {
      auto options = OptionsNamed(builder);
      if (!options) {
        return absl::InvalidArgumentError(fmt::format("there is no builder '{}'", builder));
      }
      options->max_leaf_size = leaf_size;
      if (auto status = CheckBuildOptions(*options); !status.ok()) return status;
      subjects.push_back({.options = *options});
    }
  }
  std::vector<BenchCell> cells;
  const auto add = [&](PointSet set, std::uint32_t seed, std::uint64_t photons) -> BenchCell& {
    return cells.emplace_back(
        BenchCell{.set = set,
                  .seed = seed,
                  .fresh = seed != plan.seed,
                  .photons = photons,
                  .floors = true,
                  .subjects = subjects,
                  .searches = plan.queries > 0 ? StandardSearches() : std::vector<BenchSearch>{},
                  .queries = plan.queries,
                  .repetitions = plan.repetitions});
  };
  for (const PointSet set : plan.sets) {
    for (const std::uint64_t photons : plan.photons) {
      BenchCell& cell = add(set, plan.seed, photons);
      if (photons == plan.detail_photons && plan.queries > 0) AddKs(plan.ks, cell.searches);
    }
  }
  if (plan.threads.size() > 1) {
    for (const PointSet set : plan.sets) {
      BenchCell& cell = add(set, plan.seed, plan.detail_photons);
      cell.floors = false;
      cell.subjects.clear();
      for (const std::string& builder : plan.builders) {
        for (const std::uint32_t threads : plan.threads) {
          cell.subjects.push_back({.options = *OptionsNamed(builder), .threads = threads});
        }
      }
      if (plan.queries > 0) {
        cell.searches = {Nearest(50, true, false), Density(false), CountInR1(false)};
      }
    }
  }
  for (const std::uint32_t seed : plan.fresh_seeds) {
    for (const PointSet set : plan.sets) add(set, seed, plan.detail_photons);
  }
  return cells;
}

std::string NameOfAnswers(std::uint32_t outputs) {
  if ((outputs & kOutputNeighbors) != 0) return "lists";
  return (outputs & kOutputDensity) != 0 ? "density" : "count";
}

}  // namespace treelight::client
