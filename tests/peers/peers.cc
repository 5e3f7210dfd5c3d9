// Searches of Treelight on the CPU beside those of nanoflann, FLANN and CGAL, in one program, turn
// by turn, on one thread; the CPU time of the process. Every answer of 256 queries is compared with
// brute force in double first; a library whose answers are wrong is told and left out.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/bench/workloads.h"
#include "fmt/format.h"
#include "tbb/parallel_for.h"
#include "tbb/task_arena.h"
#include "tests/peers/peer.h"
#include "tests/peers/treelight_peer.h"

namespace treelight {
namespace {

constexpr std::size_t kCheckedQueries = 256;
constexpr float kUnlimited = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kSeed = 1;

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

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

template <typename Work>
double Time(const Work& work) {
  const double start = CpuSeconds();
  work();
  return CpuSeconds() - start;
}

/// Squared distances from a query to all points, in double, ascending.
std::vector<double> BruteForce(const std::vector<float>& positions, const float* query) {
  std::vector<double> distances(positions.size() / 3);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    const double dx = double{positions[3 * i]} - query[0],
                 dy = double{positions[3 * i + 1]} - query[1],
                 dz = double{positions[3 * i + 2]} - query[2];
    distances[i] = dx * dx + dy * dy + dz * dz;
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

/// Knows the right answers to some of the queries.
class Judge {
 public:
  Judge(const std::vector<float>& positions, const std::vector<float>& queries)
      : positions_(positions), queries_(queries), truth_(kCheckedQueries) {
    tbb::parallel_for(std::size_t{0}, kCheckedQueries, [&](std::size_t i) {
      truth_[i] = BruteForce(positions, &queries[3 * Query(i)]);
    });
  }

  /// What is wrong with the answers; empty: nothing. A distance may be off by
  /// the rounding of float, and so may a count at the very radius.
  std::string WhatIsWrong(const Search& search, const Found& found) const {
    constexpr double kRounding = 1e-6;
    const double squared_radius = double{search.radius} * search.radius;
    for (std::size_t check = 0; check < kCheckedQueries; ++check) {
      const std::uint32_t least = Count(check, squared_radius * (1 - kRounding)),
                          most = Count(check, squared_radius * (1 + kRounding));
      const std::size_t q = Query(check);
      const std::uint32_t count = found.counts[q];
      const std::uint32_t cap = search.k > 0 ? search.k : std::numeric_limits<std::uint32_t>::max();
      if (count < std::min(least, cap) || count > std::min(most, cap)) {
        return fmt::format("query {}: {} photons, expected {} to {}", q, count, least, most);
      }
      if (search.k == 0) continue;
      for (std::uint32_t i = 0; i < count; ++i) {
        const double expected = truth_[check][i],
                     actual = found.squared_distances[q * search.k + i];
        if (std::fabs(actual - expected) > kRounding * expected) {
          return fmt::format("query {}: squared distance {} is {}, expected {}", q, i, actual,
                             expected);
        }
        const std::uint32_t id = found.ids[q * search.k + i];
        const double of_id = SquaredDistanceTo(q, id);
        if (std::fabs(of_id - expected) > kRounding * expected) {
          return fmt::format("query {}: neighbour {} is {}, which is not as near", q, i, id);
        }
      }
    }
    return {};
  }

 private:
  /// Checks are spread over all queries.
  std::size_t Query(std::size_t check) const {
    return queries_.size() / 3 * check / kCheckedQueries;
  }

  std::uint32_t Count(std::size_t check, double squared_radius) const {
    const auto& distances = truth_[check];
    return static_cast<std::uint32_t>(
        std::upper_bound(distances.begin(), distances.end(), squared_radius) - distances.begin());
  }

  double SquaredDistanceTo(std::size_t query, std::uint32_t id) const {
    if (3 * std::size_t{id} >= positions_.size()) return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double d = double{positions_[3 * std::size_t{id} + axis]} - queries_[3 * query + axis];
      sum += d * d;
    }
    return sum;
  }

  const std::vector<float>& positions_;
  const std::vector<float>& queries_;
  std::vector<std::vector<double>> truth_;
};

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

/// The radius within which 75 points lie on average over the queries.
struct MeanRadius {
  float radius;
  std::uint32_t median;  ///< of how many lie within it
};

MeanRadius FindMeanRadius(const std::vector<float>& positions, const std::vector<float>& queries) {
  const auto map = MakeTreelight("", MakeCpuBuilder(), {});
  map->Build(positions);
  const auto some = std::span(queries).first(std::min<std::size_t>(queries.size(), 3 * 20000));
  float low = 0, high = 2;
  Found found;
  for (int i = 0; i < 40; ++i) {
    const float radius = (low + high) / 2;
    map->Find(some, {.k = 0, .radius = radius}, found);
    const double sum = std::accumulate(found.counts.begin(), found.counts.end(), 0.0);
    (sum / static_cast<double>(found.counts.size()) < 75 ? low : high) = radius;
  }
  const auto median = found.counts.begin() + static_cast<std::ptrdiff_t>(found.counts.size() / 2);
  std::nth_element(found.counts.begin(), median, found.counts.end());
  return {low, *median};
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
    const auto [radius, median] = FindMeanRadius(workload.positions, workload.queries);
    fmt::print("{} {}: r1 {:.4g}, the median query has {}\n", NameOf(set), count, radius, median);
    for (const bool sorted : {false, true}) {
      RunOrder(set, count, sorted, radius, workload.positions,
               sorted ? InMortonOrder(workload.queries) : workload.queries);
    }
  }

 private:
  void RunOrder(PointSet set, std::size_t count, bool sorted, float radius,
                const std::vector<float>& positions, const std::vector<float>& queries) {
    const Judge judge(positions, queries);
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
          const std::string complaint = judge.WhatIsWrong(kind.search, found);
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
