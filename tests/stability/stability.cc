// Measures what each set on which methods fail does to every kind of tree: docs/stability.md is
// made of its rows. Not a test, though it exits with 1 where something is wrong; each case runs in
// a process of its own, whose memory is its peak. Times are CPU time of the process on a CPU
// without OpenCL, wall time on devices.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "fmt/format.h"
#include "tbb/global_control.h"
#include "tbb/task_arena.h"
#include "tests/answers.h"
#include "tests/cpu_seconds.h"
#include "tests/stability/child_process.h"
#include "tests/stability/hard_case.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

constexpr std::uint32_t kSeed = 7;
constexpr std::size_t kCheckedQueries = 8, kTimedQueries = 5000;

struct Flags {
  std::size_t photons = 1000000;
  int runs = 10;
  std::string device, csv;  // no device: the CPU without OpenCL
  std::vector<std::string> sets, trees;
  ChildLimits limits{.seconds = 600, .bytes = 16ull << 30};
};

double WallSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// `text` as one column of CSV.
std::string Quoted(std::string text) {
  std::replace(text.begin(), text.end(), '"', '\'');
  return '"' + text + '"';
}

/// One set against one kind of tree, in the process of the case.
class Case {
 public:
  Case(const Flags& flags, const CloudShape& shape, const StabilityTree& tree)
      : flags_(flags), shape_(shape), tree_(tree), is_native_(flags.device.empty()) {}

  /// The columns from `outcome` on.
  std::string Run() {
    auto made = is_native_ ? absl::StatusOr<std::unique_ptr<Builder>>(MakeCpuBuilder())
                           : MakeDeviceBuilder({.device = flags_.device, .cache_directory = {}});
    if (!made.ok()) throw std::runtime_error(made.status().ToString());
    Builder& builder = **made;
    const Photons photons{
        .positions = shape_.make(flags_.photons, kSeed), .powers = {}, .directions = {}};
    const std::uint64_t before = PeakResidentBytes();
    std::unique_ptr<Gatherer> map;
    const double first = Seconds([&] { map = Build(builder, photons); });
    const std::uint64_t peak = PeakResidentBytes() - before;
    double build = first;
    for (int i = 0; i < 2; ++i) {
      build = std::min(build, Seconds([&] { Build(builder, photons); }));
    }
    const std::vector<float> queries = Queries(photons);
    const float radius = MedianRadius(*map, {.positions = std::span(queries).first(3 * 100)}, 50);
    const GatherOptions nearest{.k = 50, .outputs = kOutputNeighbors | kOutputCount};
    const double gather = LeastGather(*map, queries, nearest);
    const double count = LeastGather(*map, queries, {.radius = radius});
    const double work = WorkOfSearches(*map, photons);
    const std::string outcome = Judge(builder, photons, *map, queries, nearest);
    const TreeStatistics& tree = map->report().tree;
    return fmt::format("{},{},{},{},{:.4g},{:.4g},{:.4g},{:.5g},{},{}", outcome, tree.depth,
                       tree.node_count, tree.leaf_count, 1e3 * build, 1e6 * gather / kTimedQueries,
                       1e6 * count / kTimedQueries, work, peak, map->report().device_bytes);
  }

 private:
  double Seconds(const std::function<void()>& work) const {
    const auto now = [this] { return is_native_ ? CpuSeconds() : WallSeconds(); };
    const double start = now();
    work();
    return now() - start;
  }

  std::unique_ptr<Gatherer> Build(Builder& builder, const Photons& photons) const {
    auto map = builder.Build(photons, tree_.options);
    if (!map.ok()) throw std::runtime_error(map.status().ToString());
    return *std::move(map);
  }

  static std::vector<float> Queries(const Photons& photons) {
    std::vector<float> queries;
    for (std::size_t i = 0; i < kTimedQueries; ++i) {
      const float* const p = &photons.positions[3 * (photons.size() * i / kTimedQueries)];
      queries.insert(queries.end(), p, p + 3);
    }
    return queries;
  }

  double LeastGather(const Gatherer& map, const std::vector<float>& queries,
                     const GatherOptions& options) const {
    double least = std::numeric_limits<double>::infinity();
    for (int run = 0; run < 3; ++run) {
      least = std::min(least, Seconds([&] { (void)map.Gather({.positions = queries}, options); }));
    }
    return least;
  }

  /// "right", or what is wrong.
  std::string Judge(Builder& builder, const Photons& photons, const Gatherer& map,
                    const std::vector<float>& queries, const GatherOptions& options) const {
    const Tree tree = *map.ReadTree();
    if (const auto valid = ValidateTree(tree, photons); !valid.ok()) {
      return Quoted(fmt::format("wrong: {}", valid.ToString()));
    }
    const GatherResult answer = *map.Gather({.positions = queries}, options);
    constexpr int kThreads[] = {1, 2, 8};
    for (int run = 1; run < flags_.runs; ++run) {
      const int threads = kThreads[run % 3];
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                      static_cast<std::size_t>(threads));
      bool same = false;
      tbb::task_arena(threads).execute([&] {
        const auto again = Build(builder, photons);
        same = SameTree(*again->ReadTree(), tree) &&
               SameBits(*again->Gather({.positions = queries}, options), answer);
      });
      if (!same) return fmt::format("wrong: run {} differs", run);
    }
    const HardCase hard(shape_, flags_.photons, kCheckedQueries, kSeed);
    const auto right = hard.AnswersAsBruteForce(*Build(builder, hard.photons()));
    return right ? "right" : Quoted(fmt::format("wrong: {}", right.message()));
  }

  const Flags& flags_;
  const CloudShape& shape_;
  const StabilityTree& tree_;
  const bool is_native_;
};

bool Wants(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

/// Whether nothing was wrong.
bool RunAll(const Flags& flags, std::FILE* csv) {
  fmt::print(csv,
             "set,photons,tree,device,runs,outcome,depth,inner_nodes,leaves,build_ms,k50_us,"
             "count_us,work,peak_bytes,map_bytes\n");
  bool right = true;
  for (const StabilityTree& tree : StabilityTrees()) {
    if (!Wants(flags.trees, tree.name)) continue;
    for (const CloudShape& shape : AllClouds()) {
      if (!Wants(flags.sets, shape.name)) continue;
      const ChildEnd end = RunInChild(flags.limits, [&] { return Case(flags, shape, tree).Run(); });
      const std::string columns = end.kind == ChildEnd::kReturned
                                      ? end.answer
                                      : Quoted(Describe(end, flags.limits)) + ",,,,,,,,,";
      right = right && columns.starts_with("right");
      fmt::print(csv, "{},{},{},{},{},{}\n", shape.name, flags.photons, tree.name,
                 flags.device.empty() ? "cpu" : flags.device, flags.runs, columns);
      std::fflush(csv);
      fmt::print(stderr, "{} {}: {}\n", tree.name, shape.name, columns);
    }
  }
  return right;
}

}  // namespace
}  // namespace treelight

int main(int argc, char** argv) {
  treelight::Flags flags;
  CLI::App app("What sets on which methods fail do to every kind of tree.");
  app.add_option("--photons", flags.photons, "Of each set")
      ->capture_default_str()
      ->check(CLI::Range(300, 100000000));
  app.add_option("--runs", flags.runs, "Builds that must give the same bits, on 1, 2 and 8 threads")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_option("--device", flags.device,
                 "Index or part of the name; else the CPU without OpenCL");
  app.add_option("--set", flags.sets, "Only these")->delimiter(',');
  app.add_option("--tree", flags.trees, "Only these")->delimiter(',');
  app.add_option("--csv", flags.csv, "File for the rows; else stdout");
  CLI11_PARSE(app, argc, argv);
  std::FILE* const csv = flags.csv.empty() ? stdout : std::fopen(flags.csv.c_str(), "w");
  if (csv == nullptr) {
    std::perror(flags.csv.c_str());
    return 1;
  }
  const bool right = treelight::RunAll(flags, csv);
  if (csv != stdout) std::fclose(csv);
  return right ? 0 : 1;
}
