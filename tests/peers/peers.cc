// Searches of Treelight on the CPU beside those of nanoflann, FLANN and CGAL, in one program, turn
// by turn, on one thread; the CPU time of the process. Every answer of 256 queries is compared with
// brute force in double first; a library whose answers are wrong is told and left out.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "client/bench/judge.h"
#include "client/bench/mean_radius.h"
#include "client/bench/workloads.h"
#include "fmt/format.h"
#include "tbb/task_arena.h"
#include "tests/cpu_seconds.h"
#include "tests/peers/peer.h"
#include "tests/peers/treelight_peer.h"

namespace treelight {
namespace {

constexpr float kUnlimited = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kSeed = 1, kLargestK = 100;

struct Flags {
  std::vector<std::size_t> counts = {100000, 1000000};
  std::size_t query_count = 200000;
  int runs = 5;
  std::string csv;
};

struct SearchKind {
  std::string name;
  Search search;
};

template <typename Work>
double Time(const Work& work) {
  const double start = CpuSeconds();
  work();
  return CpuSeconds() - start;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

GatherResult ToResult(const Found& found) {
  GatherResult result;
  result.counts = found.counts;
  result.neighbor_ids = found.ids;
  result.neighbor_squared_distances = found.squared_distances;
  return result;
}

std::vector<float> At(const std::vector<float>& queries, const std::vector<std::size_t>& places) {
  std::vector<float> at;
  for (const std::size_t place : places) {
    at.insert(at.end(), &queries[3 * place], &queries[3 * place] + 3);
  }
  return at;
}

class Comparison {
 public:
  Comparison(const Flags& flags, std::FILE* csv) : flags_(flags), csv_(csv) {
    for (const std::size_t leaf_size : {10, 20, 40}) peers_.push_back(MakeNanoflann(leaf_size));
    for (const int leaf_size : {10, 20}) peers_.push_back(MakeFlann(leaf_size));
    for (const unsigned bucket_size : {10, 20}) peers_.push_back(MakeCgal(bucket_size));
    own_ = peers_.size();
    const std::shared_ptr<Builder> cpu = MakeCpuBuilder();
    for (const std::uint32_t leaf_size : {8, 16, 32}) {
      peers_.push_back(MakeTreelight(fmt::format("treelight lbvh {}", leaf_size), cpu,
                                     {.max_leaf_size = leaf_size}));
      peers_.push_back(
          MakeTreelight(fmt::format("treelight hybrid {}", leaf_size), cpu,
                        {.builder = BuilderKind::kHybrid, .max_leaf_size = leaf_size}));
    }
    if (csv_ != nullptr) {
      fmt::print(csv_, "set,photons,order,search,library,unit,min,median,max\n");
    }
  }

  void Run(PointSet set, std::size_t count) {
    const Workload workload = MakeWorkload(set, count, flags_.query_count, kSeed);
    std::vector<std::vector<double>> build(peers_.size());
    for (int run = 0; run < flags_.runs; ++run) {
      for (std::size_t p = 0; p < peers_.size(); ++p) {
        build[p].push_back(Time([&] { peers_[p]->Build(workload.positions); }));
      }
    }
    Tell(set, count, "", "build", build, 1e3);
    const Photons photons{.positions = workload.positions, .powers = {}, .directions = {}};
    const auto map = MakeCpuBuilder()->Build(photons, {}).value();
    const auto r1 = FindMeanRadius(*map, workload.queries).value();
    fmt::print("{} {}: r1 {:.4g}, the median query has {}\n", NameOf(set), count, r1.radius,
               r1.median);
    for (const bool sorted : {false, true}) {
      RunOrder(set, count, sorted, r1.radius, photons,
               sorted ? InMortonOrder(workload.queries) : workload.queries);
    }
  }

 private:
  void RunOrder(PointSet set, std::size_t count, bool sorted, float radius, const Photons& photons,
                const std::vector<float>& queries) {
    const std::vector<std::size_t> places = SpreadPlaces(queries.size() / 3);
    const Judge judge(photons, At(queries, places), kLargestK, radius);
    const std::vector<SearchKind> kinds = {{"k 8", {8, kUnlimited}},
                                           {"k 50", {50, kUnlimited}},
                                           {"k 100", {100, kUnlimited}},
                                           {"k 50 in r1", {50, radius}},
                                           {"count in r1", {0, radius}}};
    const std::size_t m = queries.size() / 3;
    for (const SearchKind& kind : kinds) {
      std::vector<std::vector<double>> seconds(peers_.size());
      std::vector<bool> wrong(peers_.size());
      Found found;
      for (int run = 0; run < flags_.runs; ++run) {
        for (std::size_t p = 0; p < peers_.size(); ++p) {
          if (wrong[p]) continue;
          found = {};
          found.Resize(m, kind.search.k);
          seconds[p].push_back(Time([&] { peers_[p]->Find(queries, kind.search, found); }));
          if (run > 0) continue;
          const std::string complaint = judge.WhatIsWrong(
              {.k = kind.search.k,
               .radius = kind.search.radius,
               .outputs = kOutputCount | (kind.search.k > 0 ? kOutputNeighbors : 0)},
              ToResult(found), places);
          if (complaint.empty()) continue;
          fmt::print("{} {}: WRONG: {}: {}\n", NameOf(set), kind.name, peers_[p]->name(),
                     complaint);
          wrong[p] = true;
          seconds[p].clear();
        }
      }
      Tell(set, count, sorted ? "sorted" : "random", kind.name, seconds,
           1e6 / static_cast<double>(m));
    }
  }

  /// Prints the best of the peers beside our own.
  void Tell(PointSet set, std::size_t count, const std::string& order, const std::string& search,
            const std::vector<std::vector<double>>& seconds, double unit) {
    std::optional<std::size_t> peer, own;
    std::vector<double> medians(peers_.size());
    for (std::size_t p = 0; p < peers_.size(); ++p) {
      if (seconds[p].empty()) continue;
      medians[p] = Median(seconds[p]) * unit;
      std::optional<std::size_t>& best = p < own_ ? peer : own;
      if (!best || medians[p] < medians[*best]) best = p;
      if (csv_ == nullptr) continue;
      const auto [low, high] = std::minmax_element(seconds[p].begin(), seconds[p].end());
      fmt::print(csv_, "{},{},{},{},{},{},{:.4g},{:.4g},{:.4g}\n", NameOf(set), count, order,
                 search, peers_[p]->name(), search == "build" ? "ms" : "us a query", *low * unit,
                 medians[p], *high * unit);
    }
    if (!peer || !own) return;
    fmt::print("{} {:8} {:6} {:11}  {:20} {:8.3f}  {:20} {:8.3f}  {:5.2f}x\n", NameOf(set), count,
               order, search, peers_[*peer]->name(), medians[*peer], peers_[*own]->name(),
               medians[*own], medians[*peer] / medians[*own]);
    std::fflush(stdout);
  }

  const Flags flags_;
  std::FILE* const csv_;
  std::vector<std::unique_ptr<Peer>> peers_;
  std::size_t own_;  ///< first of ours
};

}  // namespace
}  // namespace treelight

int main(int argc, char** argv) {
  treelight::Flags flags;
  CLI::App app("Searches beside those of other libraries, one thread, CPU time.");
  app.add_option("--photons", flags.counts, "Points, one number or more")
      ->capture_default_str()
      ->check(CLI::Range(1000, 100000000));
  app.add_option("--queries", flags.query_count)
      ->capture_default_str()
      ->check(CLI::Range(256, 10000000));
  app.add_option("--runs", flags.runs)->capture_default_str()->check(CLI::Range(1, 1000));
  app.add_option("--csv", flags.csv, "File for all figures");
  CLI11_PARSE(app, argc, argv);
  // Memory that was given back is used again, as in a process that searches all the time.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  std::FILE* const csv = flags.csv.empty() ? nullptr : std::fopen(flags.csv.c_str(), "w");
  if (!flags.csv.empty() && csv == nullptr) {
    std::perror(flags.csv.c_str());
    return 1;
  }
  tbb::task_arena(1).execute([&] {
    treelight::Comparison comparison(flags, csv);
    for (const auto set : {treelight::PointSet::kUniform, treelight::PointSet::kSurfaces,
                           treelight::PointSet::kTurned}) {
      for (const std::size_t count : flags.counts) comparison.Run(set, count);
    }
  });
  if (csv != nullptr) std::fclose(csv);
  return 0;
}
