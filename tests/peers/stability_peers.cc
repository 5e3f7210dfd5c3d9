// What nanoflann, FLANN, CGAL and Treelight do with sets on which methods fail: right, wrong
// (judged by brute force in double), a crash, no end, or more memory than they may take. Each case
// runs in a process of its own on one thread; CPU time. docs/stability.md is made of the rows.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "client/bench/judge.h"
#include "core/builder.h"
#include "fmt/format.h"
#include "tbb/task_arena.h"
#include "tests/answers.h"
#include "tests/clouds.h"
#include "tests/cpu_seconds.h"
#include "tests/peers/peer.h"
#include "tests/peers/treelight_peer.h"
#include "tests/stability/child_process.h"

namespace treelight {
namespace {

constexpr float kUnlimited = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kSeed = 7, kLargestK = 50;
constexpr std::size_t kChecked = 64, kTimed = 2000;

struct Flags {
  std::size_t photons = 200000;
  std::string csv;
  std::vector<std::string> sets;
  ChildLimits limits{.seconds = 60, .bytes = 4ull << 30};
};

struct Set {
  std::string name;
  CloudShape shape;
  std::size_t photons;
};

struct Library {
  std::string name;
  std::unique_ptr<Peer> (*make)();
};

/// Coordinates whose squared distances overflow in float.
std::vector<float> BeyondTheLimit(std::size_t count, std::uint32_t seed) {
  std::vector<float> positions = CloudNamed("uniform").make(count, seed);
  for (float& c : positions) c = (2 * c - 1) * 3e38f;
  return positions;
}

std::vector<Set> MakeSets(const Flags& flags) {
  std::vector<Set> sets;
  for (const CloudShape& shape : AllClouds()) sets.push_back({shape.name, shape, flags.photons});
  sets.push_back({"31_photons", CloudNamed("uniform"), 31});  // fewer than k
  sets.push_back({"beyond_limit", {"beyond_limit", BeyondTheLimit}, flags.photons});
  std::erase_if(sets, [&](const Set& set) {
    return !flags.sets.empty() && std::ranges::find(flags.sets, set.name) == flags.sets.end();
  });
  return sets;
}

std::vector<Library> Libraries() {
  return {{"nanoflann", [] { return MakeNanoflann(10); }},
          {"FLANN", [] { return MakeFlann(10); }},
          {"CGAL", [] { return MakeCgal(10); }},
          {"treelight lbvh",
           [] { return MakeTreelight("lbvh", MakeCpuBuilder(), {.max_leaf_size = 8}); }},
          {"treelight hybrid", [] {
             return MakeTreelight("hybrid", MakeCpuBuilder(),
                                  {.builder = BuilderKind::kHybrid, .max_leaf_size = 8});
           }}};
}

Photons MakePhotons(const Set& set) {
  return {.positions = set.shape.make(set.photons, kSeed), .powers = {}, .directions = {}};
}

/// The k-th distance of the median query, as text: a radius that tells sets of all scales.
std::string FindRadius(const Set& set) {
  const Photons photons = MakePhotons(set);
  const auto map = MakeBruteForceBuilder()->Build(photons, {});
  if (!map.ok()) return "1e38";  // no map of ours
  const std::vector<float> queries = MakeQueries(photons, 100, kSeed + 2);
  return fmt::format("{:.9g}", MedianRadius(**map, {.positions = queries}, kLargestK));
}

/// One set against one library, in the process of the case.
class Case {
 public:
  Case(const Set& set, const Library& library, float radius)
      : photons_(MakePhotons(set)),
        peer_(library.make()),
        queries_(MakeQueries(photons_, kChecked, kSeed + 1)),
        radius_(radius) {}

  /// The columns from `outcome` on.
  std::string Run() {
    const std::uint64_t before = PeakResidentBytes();
    const double start = CpuSeconds();
    peer_->Build(photons_.positions);
    const double build = CpuSeconds() - start;
    const std::uint64_t peak = PeakResidentBytes() - before;
    const double nearest = Time({kLargestK, kUnlimited}), count = Time({0, radius_});
    return fmt::format("{},{:.4g},{:.4g},{:.4g},{}", Judged(), 1e3 * build, nearest, count, peak);
  }

 private:
  /// Microseconds of a query at a photon.
  double Time(const Search& search) const {
    std::vector<float> queries;
    for (std::size_t i = 0; i < kTimed; ++i) {
      const float* const p = &photons_.positions[3 * (photons_.size() * i / kTimed)];
      queries.insert(queries.end(), p, p + 3);
    }
    Found found;
    found.Resize(kTimed, search.k);
    const double start = CpuSeconds();
    peer_->Find(queries, search, found);
    return 1e6 * (CpuSeconds() - start) / kTimed;
  }

  std::string Judged() const {
    const Judge judge(photons_, queries_, kLargestK, radius_);
    std::vector<std::size_t> places(kChecked);
    for (std::size_t i = 0; i < kChecked; ++i) places[i] = i;
    for (const Search& search :
         {Search{1, kUnlimited}, Search{8, kUnlimited}, Search{50, kUnlimited}, Search{50, radius_},
          Search{0, radius_}, Search{0, 0}}) {
      Found found;
      found.Resize(kChecked, search.k);
      peer_->Find(queries_, search, found);
      GatherResult result;
      result.counts = found.counts;
      result.neighbor_ids = found.ids;
      result.neighbor_squared_distances = found.squared_distances;
      const std::string wrong =
          judge.WhatIsWrong({.k = search.k,
                             .radius = search.radius,
                             .outputs = kOutputCount | (search.k > 0 ? kOutputNeighbors : 0)},
                            result, places);
      if (!wrong.empty()) {
        return fmt::format("\"wrong: k {} within {:g}: {}\"", search.k, search.radius, wrong);
      }
    }
    return "right";
  }

  const Photons photons_;
  const std::unique_ptr<Peer> peer_;
  const std::vector<float> queries_;
  const float radius_;
};

void RunAll(const Flags& flags, std::FILE* csv) {
  fmt::print(csv, "set,photons,library,outcome,build_ms,k50_us,count_us,peak_bytes\n");
  for (const Set& set : MakeSets(flags)) {
    const ChildEnd radius = RunInChild(flags.limits, [&] { return FindRadius(set); });
    for (const Library& library : Libraries()) {
      const ChildEnd end = RunInChild(flags.limits, [&] {
        std::string columns;
        tbb::task_arena(1).execute(
            [&] { columns = Case(set, library, std::stof(radius.answer)).Run(); });
        return columns;
      });
      const std::string columns = end.kind == ChildEnd::kReturned
                                      ? end.answer
                                      : fmt::format("\"{}\",,,,", Describe(end, flags.limits));
      fmt::print(csv, "{},{},{},{}\n", set.name, set.photons, library.name, columns);
      std::fflush(csv);
      fmt::print(stderr, "{} {}: {}\n", set.name, library.name, columns);
    }
  }
}

}  // namespace
}  // namespace treelight

int main(int argc, char** argv) {
  treelight::Flags flags;
  CLI::App app("What other libraries do with sets on which methods fail.");
  app.add_option("--photons", flags.photons, "Of each set")
      ->capture_default_str()
      ->check(CLI::Range(300, 100000000));
  app.add_option("--set", flags.sets, "Only these")->delimiter(',');
  app.add_option("--seconds", flags.limits.seconds, "That a case may take")
      ->capture_default_str()
      ->check(CLI::Range(1, 3600));
  app.add_option("--csv", flags.csv, "File for the rows; else stdout");
  CLI11_PARSE(app, argc, argv);
  std::FILE* const csv = flags.csv.empty() ? stdout : std::fopen(flags.csv.c_str(), "w");
  if (csv == nullptr) {
    std::perror(flags.csv.c_str());
    return 1;
  }
  treelight::RunAll(flags, csv);
  if (csv != stdout) std::fclose(csv);
  return 0;
}
