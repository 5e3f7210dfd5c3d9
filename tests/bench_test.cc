#include "client/bench/bench.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/bench/judge.h"
#include "client/bench/mean_radius.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/forwarding_gatherer.h"

namespace treelight::client {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr float kUnlimited = std::numeric_limits<float>::infinity();
using Spoil = std::function<void(const GatherOptions&, GatherResult&)>;

std::string NativeIndex() {
  for (const DeviceInfo& device : ListDevices()) {
    if (device.platform == kNativePlatform) return std::to_string(device.index);
  }
  return "none";
}

/// Maps of the CPU whose answers are spoiled.
class SpoilingBuilder : public Builder {
 public:
  explicit SpoilingBuilder(Spoil spoil) : spoil_(std::move(spoil)) {}

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    auto map = cpu_->Build(photons, options, cancelled);
    if (!map.ok()) return map.status();
    return std::make_unique<Map>(*std::move(map), spoil_);
  }

  std::uint64_t WorkBytes(const BuildOptions& options, std::uint64_t photon_count) const override {
    return cpu_->WorkBytes(options, photon_count);
  }

 private:
  class Map : public treelight::testing::ForwardingGatherer {
   public:
    Map(std::unique_ptr<Gatherer> map, Spoil spoil)
        : ForwardingGatherer(std::move(map)), spoil_(std::move(spoil)) {}
    absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                        const CancelCheck& cancelled) const override {
      auto found = ForwardingGatherer::Gather(queries, options, cancelled);
      if (found.ok() && spoil_) spoil_(options, *found);
      return found;
    }

   private:
    const Spoil spoil_;
  };

  const std::unique_ptr<Builder> cpu_ = MakeCpuBuilder();
  const Spoil spoil_;
};

BenchPlan SmallPlan() {
  BenchPlan plan;
  plan.sets = {PointSet::kSurfaces};
  plan.photons = {2'000, 4'000};
  plan.detail_photons = 4'000;
  plan.leaf_sizes = {8, 16};
  plan.ks = {3, 120};
  plan.queries = 500;
  plan.repetitions = 2;
  return plan;
}

/// What a run gave.
struct Report {
  absl::Status status;
  std::vector<BenchRow> rows;
  std::vector<std::string> notes;
};

Report Measure(const BenchPlan& plan, const Spoil& spoil = {}, std::uint64_t host_bytes = 0) {
  Report report;
  SpoilingBuilder builder(spoil);
  const BenchListener listener{
      .row =
          [&](const BenchRow& row) {
            report.rows.push_back(row);
            return absl::OkStatus();
          },
      .progress = [](const std::string&) {},
      .note = [&](const std::string& line) { report.notes.push_back(line); }};
  report.status = RunBench({.builder = builder,
                            .machine = "a machine",
                            .name = "a device",
                            .threads = 2,
                            .host_bytes = host_bytes,
                            .maps_on_host = true},
                           plan, listener);
  return report;
}

std::vector<std::string> Names(const Report& report, const std::string& figure,
                               std::uint64_t photons) {
  std::vector<std::string> names;
  for (const BenchRow& row : report.rows) {
    if (row.figure == figure && row.photons == photons && row.leaf_size == 8 &&
        row.builder == "lbvh") {
      names.push_back(row.name + (row.order.empty() ? "" : ", " + row.order));
    }
  }
  return names;
}

TEST(BenchTest, EveryTreeIsBuiltAndSearched) {
  BenchPlan plan = SmallPlan();
  plan.fresh_seeds = {77};
  plan.threads = {1, 2};
  const Report report = Measure(plan);
  ASSERT_TRUE(report.status.ok()) << report.status;
  EXPECT_THAT(report.notes, IsEmpty());
  EXPECT_THAT(Names(report, "gather", 2'000),
              ElementsAre("k 8, random", "k 50, random", "k 100, random", "k 50 in r1, random",
                          "density of 50 in r1, random", "count in r1, random", "k 8, sorted",
                          "k 50, sorted", "k 100, sorted", "k 50 in r1, sorted",
                          "density of 50 in r1, sorted", "count in r1, sorted"));
  EXPECT_THAT(Names(report, "gather", 4'000),
              ::testing::IsSupersetOf({"k 3, random", "k 3 in r1, random", "k 120, random"}));
  EXPECT_THAT(Names(report, "gather", 4'000), Not(::testing::Contains("k 120 in r1, random")));
  std::set<std::uint32_t> leaf_sizes, threads, fresh;
  for (const BenchRow& row : report.rows) {
    const std::string line = BenchCsvLine(row);
    EXPECT_LE(row.device.min_ms, row.device.median_ms) << line;
    EXPECT_LE(row.device.median_ms, row.device.max_ms) << line;
    EXPECT_GT(row.device.min_ms, 0) << line;
    EXPECT_EQ(row.repetitions, 2u) << line;
    EXPECT_EQ(row.machine, "a machine");
    EXPECT_EQ(row.device_name, "a device");
    if (row.figure == "build" || row.figure == "gather") {
      EXPECT_EQ(row.checked, 256u) << line;
      EXPECT_GE(row.wall->median_ms, row.device.median_ms * 0.99) << line;
      leaf_sizes.insert(row.leaf_size);
      threads.insert(row.threads);
    }
    if (row.fresh) fresh.insert(row.seed);
    if (row.name == "count in r1") {
      EXPECT_GT(row.radius, 0) << line;
      EXPECT_NEAR(row.per_second * row.device.median_ms / 1000, 500, 1e-6) << line;
    }
  }
  EXPECT_THAT(leaf_sizes, ElementsAre(8, 16));
  EXPECT_THAT(threads, ElementsAre(1, 2));
  EXPECT_THAT(fresh, ElementsAre(77));
}

TEST(BenchTest, FloorsAreMeasuredBesideBuilds) {
  BenchPlan plan = SmallPlan();
  plan.queries = 0;
  plan.photons = {4'000};
  SpoilingBuilder builder({});
  const auto floors = MakeFloorMeter({.device = NativeIndex(), .cache_directory = {}});
  ASSERT_TRUE(floors.ok()) << floors.status();
  std::vector<std::string> names;
  const absl::Status status = RunBench({.builder = builder, .floors = floors->get()}, plan,
                                       {.row =
                                            [&](const BenchRow& row) {
                                              EXPECT_NE(row.figure, "gather");
                                              if (row.figure == "floor") names.push_back(row.name);
                                              return absl::OkStatus();
                                            },
                                        .progress = [](const std::string&) {},
                                        .note = [](const std::string&) {}});
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(names, ElementsAre("sort of 32-bit keys", "sort of 64-bit keys", "copy"));
}

TEST(BenchTest, TheCsvHasAColumnForEachCell) {
  const std::string header = BenchCsvHeader();
  const auto commas = [](const std::string& line) { return std::ranges::count(line, ','); };
  BenchRow row{.figure = "build", .machine = "a, \"quoted\"\nname", .device_name = "b"};
  EXPECT_EQ(commas(BenchCsvLine(row)), commas(header));
  EXPECT_THAT(BenchCsvLine(row), AllOf(HasSubstr("a   quoted  name"), HasSubstr(",,,")));
  row.wall = Spread{1, 2, 3};
  EXPECT_THAT(BenchCsvLine(row), HasSubstr(",1,2,3,"));
}

TEST(BenchTest, TheMedianOfAnEvenNumberIsBetweenTheMiddleOnes) {
  const Spread odd = MakeSpread({3, 1, 2}), even = MakeSpread({4, 1, 3, 2});
  EXPECT_EQ(odd.median_ms, 2);
  EXPECT_EQ(even.median_ms, 2.5);
  EXPECT_EQ(even.min_ms, 1);
  EXPECT_EQ(even.max_ms, 4);
}

TEST(BenchTest, WrongAnswersAreNotReported) {
  const Report report = Measure(SmallPlan(), [](const GatherOptions& options, GatherResult& found) {
    const bool lists = (options.outputs & kOutputNeighbors) != 0;
    if (options.k != 8 || !lists) return;
    // The nearest and the last of each list change their places.
    for (std::size_t i = 0; i < found.neighbor_ids.size(); i += 8) {
      std::swap(found.neighbor_ids[i], found.neighbor_ids[i + 7]);
    }
  });
  EXPECT_EQ(report.status.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(report.status.message()),
              AllOf(HasSubstr("16 figures are not reported"),
                    HasSubstr("gather k 8 in lbvh (8), W2, 2000 photons, seed 1: query "),
                    HasSubstr("which is not as near")));
  EXPECT_EQ(report.notes.size(), 16u);  // of two counts of photons, four trees, two orders
  for (const BenchRow& row : report.rows) EXPECT_NE(row.name, "k 8");
  EXPECT_THAT(Names(report, "gather", 4'000), ::testing::Contains("k 50, sorted"));
}

TEST(BenchTest, AnswersThatBecomeWrongLaterAreNotReported) {
  int gathers = 0;
  BenchPlan plan = SmallPlan();
  plan.photons = {2'000};
  plan.builders = {"lbvh"};
  plan.leaf_sizes = {8};
  plan.repetitions = 5;
  const Report report = Measure(plan, [&](const GatherOptions& options, GatherResult& found) {
    const bool density = (options.outputs & kOutputDensity) != 0;
    // The last turn of the random order, at one place that is judged.
    if (density && ++gathers == 6) found.densities[3] *= 1.001f;
  });
  EXPECT_THAT(std::string(report.status.message()), HasSubstr("1 figures are not reported"));
  EXPECT_THAT(Names(report, "gather", 2'000),
              AllOf(Not(::testing::Contains("density of 50 in r1, random")),
                    ::testing::Contains("density of 50 in r1, sorted")));
}

TEST(BenchTest, ATreeWhoseAnswersAreWrongIsNoBuild) {
  const Report report = Measure(SmallPlan(), [](const GatherOptions& options, GatherResult& found) {
    if (options.k == 50) found.counts.assign(found.counts.size(), 49);
  });
  EXPECT_EQ(report.status.code(), absl::StatusCode::kInternal);
  for (const BenchRow& row : report.rows) {
    EXPECT_NE(row.figure, "build");
    EXPECT_NE(row.figure, "stage");
  }
}

TEST(BenchTest, WhatDoesNotFitEndsTheSetAndIsTold) {
  BenchPlan plan = SmallPlan();
  plan.sets = {PointSet::kUniform, PointSet::kSurfaces};
  plan.fresh_seeds = {3};
  const Report report = Measure(plan, {}, /*host_bytes=*/2'000'000);
  EXPECT_TRUE(report.status.ok()) << report.status;
  EXPECT_THAT(report.notes,
              ElementsAre(AllOf(HasSubstr("W1 ends before 4000 photons: photons, 4 trees"),
                                HasSubstr("this process may use 1.9 MiB")),
                          HasSubstr("W2 ends before 4000 photons")));
  EXPECT_FALSE(report.rows.empty());
  for (const BenchRow& row : report.rows) EXPECT_EQ(row.photons, 2'000u);
}

TEST(BenchTest, NothingMeasuredIsAnError) {
  const Report report = Measure(SmallPlan(), {}, /*host_bytes=*/1'000);
  EXPECT_TRUE(absl::IsResourceExhausted(report.status)) << report.status;
  EXPECT_THAT(report.rows, IsEmpty());
}

TEST(BenchTest, PlansNameWhatIsWrongWithThem) {
  BenchPlan plan = SmallPlan();
  plan.builders = {"oak"};
  EXPECT_THAT(std::string(MakeCells(plan).status().message()), HasSubstr("no builder 'oak'"));
  plan.builders = {"isa"};
  plan.leaf_sizes = {65};
  EXPECT_THAT(std::string(MakeCells(plan).status().message()), HasSubstr("max_leaf_size is 65"));
}

// Four photons on a line, queries at its end.
class JudgeTest : public ::testing::Test {
 protected:
  const Photons photons_{.positions = {1, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0, 0},
                         .powers = {1, 0, 0, 1, 0, 0, 1, 2, 0, 1, 0, 0},
                         .directions = {}};
  const Judge judge_{photons_, {0, 0, 0}, /*max_k=*/2, /*max_radius=*/3.5f};
  const std::vector<std::size_t> places_ = {0};

  std::string Count(std::uint32_t k, float radius, std::uint32_t count) const {
    GatherResult found;
    found.counts = {count};
    return judge_.WhatIsWrong({.k = k, .radius = radius, .outputs = kOutputCount}, found, places_);
  }

  std::string List(std::vector<std::uint32_t> ids, std::vector<float> squared_distances) const {
    GatherResult found;
    found.counts = {2};
    found.neighbor_ids = std::move(ids);
    found.neighbor_squared_distances = std::move(squared_distances);
    return judge_.WhatIsWrong(
        {.k = 2, .radius = kUnlimited, .outputs = kOutputCount | kOutputNeighbors}, found, places_);
  }

  std::string Density(std::uint32_t k, float radius, std::vector<float> densities) const {
    GatherResult found;
    found.densities = std::move(densities);
    return judge_.WhatIsWrong({.k = k, .radius = radius, .outputs = kOutputDensity}, found,
                              places_);
  }
};

TEST_F(JudgeTest, CountsAreThoseWithinTheRadius) {
  EXPECT_EQ(Count(0, 3.5f, 3), "");
  EXPECT_EQ(Count(0, 2.5f, 2), "");
  EXPECT_EQ(Count(2, 3.5f, 2), "");
  EXPECT_EQ(Count(0, 2.5f, 3), "query 0: 3 photons, expected 2 to 2");
  EXPECT_THAT(Count(0, 2.5f, 1), HasSubstr("1 photons"));
  EXPECT_EQ(Count(0, 2, 2), "");  // at the very radius either is right
  EXPECT_EQ(Count(0, 2, 1), "");
}

TEST_F(JudgeTest, ListsAreTheNearest) {
  EXPECT_EQ(List({0, 1}, {1, 4}), "");
  EXPECT_EQ(List({0, 1}, {1, 4.1f}), "query 0: squared distance 1 is 4.1, expected 4");
  EXPECT_EQ(List({0, 2}, {1, 4}), "query 0: neighbour 1 is 2, which is not as near");
  EXPECT_EQ(List({0, 9}, {1, 4}), "query 0: neighbour 1 is 9, which is not as near");
  const Photons twins{.positions = {1, 0, 0, 1, 0, 0}, .powers = {}, .directions = {}};
  const Judge judge(twins, {0, 0, 0}, /*max_k=*/2, /*max_radius=*/1);
  GatherResult found;
  found.counts = {2};
  found.neighbor_ids = {1, 1};
  found.neighbor_squared_distances = {1, 1};
  EXPECT_EQ(judge.WhatIsWrong({.k = 2, .outputs = kOutputCount | kOutputNeighbors}, found, places_),
            "query 0: neighbour 1 is there twice");
}

TEST_F(JudgeTest, DensitiesAreTheSumsOfTheKernel) {
  // Epanechnikov, r = 3.5: 2 (1 - d2 / 12.25) / (pi 12.25) of d2 = 1, 4, 9.
  const float red = 2 * (3 - 14 / 12.25f) / (3.14159265f * 12.25f);
  const float green = 2 * 2 * (1 - 9 / 12.25f) / (3.14159265f * 12.25f);
  EXPECT_EQ(Density(0, 3.5f, {red, green, 0}), "");
  EXPECT_THAT(Density(0, 3.5f, {red * 1.001f, green, 0}), HasSubstr("density 0 is"));
  EXPECT_THAT(Density(0, 3.5f, {red, green, 0.001f}), HasSubstr("density 2 is 0.001, expected 0"));
  // Two nearest: R = 2, only the first has weight.
  const float of_two = 2 * (1 - 1 / 4.0f) / (3.14159265f * 4);
  EXPECT_EQ(Density(2, 3.5f, {of_two, 0, 0}), "");
}

TEST(JudgePlacesTest, AreFoundAgainInAnotherOrder) {
  const std::vector<float> batch = {0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3};
  EXPECT_THAT(SpreadPlaces(4, 2), ElementsAre(0, 2));
  EXPECT_THAT(FindPlaces(std::vector<float>{3, 3, 3, 1, 1, 1}, batch), ElementsAre(3, 1));
}

TEST(MeanRadiusTest, HoldsSeventyFivePhotonsOnAverage) {
  const Workload workload = MakeWorkload(PointSet::kUniform, 50'000, 5'000, 4);
  const auto map = MakeCpuBuilder()->Build(
      {.positions = workload.positions, .powers = {}, .directions = {}}, {});
  ASSERT_TRUE(map.ok()) << map.status();
  const auto r1 = FindMeanRadius(**map, workload.queries);
  ASSERT_TRUE(r1.ok()) << r1.status();
  // A ball of 75 of 50 000 photons in the unit cube, a little larger where it crosses the walls.
  EXPECT_NEAR(r1->radius, 0.0710, 0.004);
  EXPECT_NEAR(r1->median, 75, 6);
}

}  // namespace
}  // namespace treelight::client
