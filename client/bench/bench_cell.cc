#include "client/bench/bench_cell.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <numeric>
#include <random>
#include <span>
#include <utility>

#include "client/bench/judge.h"
#include "client/bench/mean_radius.h"
#include "fmt/format.h"
#include "tbb/task_arena.h"

namespace treelight::client {
namespace {

using Maps = std::vector<std::unique_ptr<Gatherer>>;
using Times = std::vector<double>;  // milliseconds

// Neighbours in the answer to one gather, at most: 1 GB.
constexpr std::uint64_t kMostNeighbors = 125'000'000;

const BenchSearch kBuildCheck = {
    .name = "check", .k = 50, .outputs = kOutputCount | kOutputNeighbors};

/// Calls `work` on as many threads of this program; 0: on all.
template <typename Work>
auto OnThreads(std::uint32_t threads, const Work& work) {
  if (threads == 0) return work();
  tbb::task_arena arena(static_cast<int>(threads));
  return arena.execute(work);
}

class Stopwatch {
 public:
  double ms() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_)
        .count();
  }

 private:
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Times of the parts of something, by the names of the parts, in the order in which they came.
class NamedTimes {
 public:
  void Add(const std::string& name, double ms) {
    auto found = std::ranges::find(times_, name, &std::pair<std::string, Times>::first);
    if (found == times_.end()) found = times_.insert(found, {name, {}});
    found->second.push_back(ms);
  }
  auto begin() const { return times_.begin(); }
  auto end() const { return times_.end(); }

 private:
  std::vector<std::pair<std::string, Times>> times_;
};

/// The device's own time of a build, photons there at first, milliseconds.
double DeviceMs(const BuildReport& report) {
  double us = 0;
  for (const StageTime& stage : report.stages) {
    if (stage.stage != "upload") us += stage.microseconds;
  }
  return us / 1000;
}

std::vector<float> RandomPowers(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<float> powers(3 * count);
  for (float& power : powers) power = static_cast<float>(random() >> 8) * 0x1p-24f;
  return powers;
}

/// The queries of a gather, among them those that are judged.
struct Batch {
  std::vector<float> queries;       // [3m]
  std::vector<std::size_t> places;  // of the judge's queries
};

class Cell {
 public:
  Cell(const BenchDevice& device, const BenchCell& cell, const BenchListener& listener)
      : device_(device), cell_(cell), listener_(listener), maps_(cell.subjects.size()) {
    Workload workload =
        MakeWorkload(cell.set, cell.photons, QueryCount() + kCheckedQueries, cell.seed);
    photons_.positions = std::move(workload.positions);
    photons_.powers = RandomPowers(cell.photons, cell.seed);
    const auto first_other = workload.queries.begin() + 3 * kCheckedQueries;
    judged_.assign(workload.queries.begin(), first_other);
    others_.assign(first_other, workload.queries.end());
  }

  absl::StatusOr<CellOutcome> Run() {
    for (std::size_t i = 0; i < maps_.size(); ++i) {  // the first turn
      if (auto status = Build(i); !status.ok()) return status;
    }
    if (auto status = PrepareJudge(); !status.ok()) return status;
    if (auto status = MeasureBuilds(); !status.ok()) return status;
    if (auto status = MeasureSearches(); !status.ok()) return status;
    for (const auto& map : maps_) outcome_.map_bytes += map->report().device_bytes;
    return std::move(outcome_);
  }

 private:
  std::uint64_t QueryCount() const {
    return std::max<std::uint64_t>(cell_.queries, kCheckedQueries);
  }

  absl::Status Build(std::size_t subject) {
    maps_[subject].reset();
    auto map = OnThreads(cell_.subjects[subject].threads, [&] {
      return device_.builder.Build(photons_, cell_.subjects[subject].options);
    });
    if (!map.ok()) return map.status();
    maps_[subject] = *std::move(map);
    return absl::OkStatus();
  }

  absl::Status PrepareJudge() {
    std::uint32_t max_k = kBuildCheck.k;
    for (const BenchSearch& search : cell_.searches) max_k = std::max(max_k, search.k);
    if (!cell_.searches.empty()) {
      const auto r1 = FindMeanRadius(*maps_.front(), others_);
      if (!r1.ok()) return r1.status();
      r1_ = r1->radius;
    }
    judge_ = std::make_unique<Judge>(photons_, judged_, max_k, r1_);
    return absl::OkStatus();
  }

  absl::Status MeasureBuilds() {
    const std::size_t count = maps_.size();
    std::vector<Times> device(count), wall(count);
    std::vector<NamedTimes> stages(count);
    std::vector<std::string> wrong(count);
    NamedTimes floors;
    std::uint64_t copy_bytes = 0;
    const Batch checked{judged_, SpreadPlaces(kCheckedQueries)};
    for (std::uint32_t turn = 0; turn < cell_.repetitions; ++turn) {
      if (cell_.floors && device_.floors != nullptr) {
        const auto measured = device_.floors->Measure(photons_.size());
        if (!measured.ok()) return measured.status();
        floors.Add("sort of 32-bit keys", measured->sort_32_us / 1000);
        floors.Add("sort of 64-bit keys", measured->sort_64_us / 1000);
        floors.Add("copy", measured->copy_us / 1000);
        copy_bytes = measured->copy_bytes;
      }
      for (std::size_t i = 0; i < count; ++i) {
        const Stopwatch watch;
        if (auto status = Build(i); !status.ok()) return status;
        wall[i].push_back(watch.ms());
        const BuildReport& report = maps_[i]->report();
        device[i].push_back(DeviceMs(report));
        for (const StageTime& stage : report.stages) {
          stages[i].Add(stage.stage, stage.microseconds / 1000);
        }
        double device_ms = 0, wall_ms = 0;
        auto found = Gather(i, kBuildCheck, checked, device_ms, wall_ms);
        if (!found.ok()) return found.status();
        if (wrong[i].empty()) wrong[i] = *found;
      }
    }
    for (const auto& [name, times] : floors) {
      const auto amount = name == "copy" ? 2 * copy_bytes : photons_.size();
      if (auto status = Tell(Row("floor", name, times, amount)); !status.ok()) return status;
    }
    for (std::size_t i = 0; i < count; ++i) {
      BenchRow row = Row("build", "whole", device[i], photons_.size());
      Describe(i, row);
      row.wall = MakeSpread(wall[i]);
      row.checked = kCheckedQueries;
      if (!wrong[i].empty()) {
        Complain(row, wrong[i]);
        continue;
      }
      if (auto status = Tell(row); !status.ok()) return status;
      for (const auto& [name, times] : stages[i]) {
        BenchRow stage = Row("stage", name, times, photons_.size());
        Describe(i, stage);
        if (auto status = Tell(stage); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

  absl::Status MeasureSearches() {
    for (const BenchSearch& search : cell_.searches) {
      const Batch batch = MakeBatch(search);
      std::vector<Times> device(maps_.size()), wall(maps_.size());
      std::vector<std::string> wrong(maps_.size());
      for (std::uint32_t turn = 0; turn <= cell_.repetitions; ++turn) {
        for (std::size_t i = 0; i < maps_.size(); ++i) {
          if (!wrong[i].empty()) continue;
          double device_ms = 0, wall_ms = 0;
          const auto found = Gather(i, search, batch, device_ms, wall_ms);
          if (!found.ok()) return found.status();
          wrong[i] = *found;
          if (turn == 0) continue;
          device[i].push_back(device_ms);
          wall[i].push_back(wall_ms);
        }
      }
      for (std::size_t i = 0; i < maps_.size(); ++i) {
        BenchRow row = Row("gather", search.name, device[i], batch.queries.size() / 3);
        Describe(i, row);
        row.k = search.k;
        row.radius = Radius(search);
        row.answers = NameOfAnswers(search.outputs);
        row.order = search.sorted ? "sorted" : "random";
        row.queries = batch.queries.size() / 3;
        row.checked = kCheckedQueries;
        if (!wrong[i].empty()) {
          Complain(row, wrong[i]);
          continue;
        }
        row.wall = MakeSpread(wall[i]);
        if (auto status = Tell(row); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

  /// As many queries as the answer has room for, those that are judged spread over them.
  Batch MakeBatch(const BenchSearch& search) const {
    const std::uint64_t room = kMostNeighbors / std::max(1u, search.k);
    const std::size_t count =
        std::max<std::uint64_t>(kCheckedQueries, std::min(QueryCount(), room));
    Batch batch{
        .queries = {others_.begin(), others_.begin() + static_cast<std::ptrdiff_t>(3 * count)},
        .places = SpreadPlaces(count)};
    for (std::size_t i = 0; i < kCheckedQueries; ++i) {
      std::copy_n(&judged_[3 * i], 3, &batch.queries[3 * batch.places[i]]);
    }
    if (!search.sorted) return batch;
    batch.queries = InMortonOrder(batch.queries);
    batch.places = FindPlaces(judged_, batch.queries);
    return batch;
  }

  float Radius(const BenchSearch& search) const {
    return search.in_r1 ? r1_ : std::numeric_limits<float>::infinity();
  }

  /// Times one gather; returns what is wrong with the answers.
  absl::StatusOr<std::string> Gather(std::size_t subject, const BenchSearch& search,
                                     const Batch& batch, double& device_ms, double& wall_ms) const {
    const GatherOptions options{.k = search.k, .radius = Radius(search), .outputs = search.outputs};
    const Stopwatch watch;
    const auto found = OnThreads(cell_.subjects[subject].threads, [&] {
      return maps_[subject]->Gather({.positions = batch.queries}, options);
    });
    wall_ms = watch.ms();
    if (!found.ok()) return found.status();
    device_ms = found->times.kernel_us / 1000;
    return judge_->WhatIsWrong(options, *found, batch.places);
  }

  /// `items` is what one repetition works on.
  BenchRow Row(const char* figure, const std::string& name, const Times& device,
               std::uint64_t items) const {
    BenchRow row{.figure = figure,
                 .name = name,
                 .set = NameOf(cell_.set),
                 .seed = cell_.seed,
                 .fresh = cell_.fresh,
                 .photons = photons_.size(),
                 .threads = device_.threads,
                 .repetitions = cell_.repetitions,
                 .machine = device_.machine,
                 .device_name = device_.name};
    if (device.empty()) return row;
    row.device = MakeSpread(device);
    if (row.device.median_ms > 0) {
      row.per_second = 1000 * static_cast<double>(items) / row.device.median_ms;
    }
    return row;
  }

  void Describe(std::size_t subject, BenchRow& row) const {
    const BenchSubject& described = cell_.subjects[subject];
    row.builder = BuilderName(described.options);
    row.leaf_size = described.options.max_leaf_size;
    if (described.threads > 0) row.threads = described.threads;
  }

  absl::Status Tell(const BenchRow& row) const { return listener_.row(row); }

  void Complain(const BenchRow& row, const std::string& wrong) {
    outcome_.wrong.push_back(fmt::format("{} {} in {} ({}), {}, {} photons, seed {}: {}",
                                         row.figure, row.name, row.builder, row.leaf_size, row.set,
                                         row.photons, row.seed, wrong));
    listener_.note(fmt::format("WRONG, not reported: {}", outcome_.wrong.back()));
  }

  const BenchDevice& device_;
  const BenchCell& cell_;
  const BenchListener& listener_;
  Photons photons_;
  std::vector<float> judged_, others_;  // queries in random order
  float r1_ = 0;
  std::unique_ptr<Judge> judge_;
  Maps maps_;  // by subject
  CellOutcome outcome_;
};

}  // namespace

absl::StatusOr<CellOutcome> MeasureCell(const BenchDevice& device, const BenchCell& cell,
                                        const BenchListener& listener) {
  return Cell(device, cell, listener).Run();
}

}  // namespace treelight::client
