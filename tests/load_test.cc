#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "client/load/load_run.h"
#include "client/load/load_table.h"
#include "gtest/gtest.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

using std::chrono::nanoseconds;
using std::chrono_literals::operator""ms;

std::vector<nanoseconds> Times(const LoadOptions& options) {
  IntendedTimes intended(options);
  std::vector<nanoseconds> times;
  while (const auto time = intended.Next()) times.push_back(*time);
  return times;
}

TEST(LoadTest, IntendedTimesHaveTheRate) {
  LoadOptions options{.arrivals = Arrivals::kConstant, .rate = 100, .duration = 1000ms};
  const auto constant = Times(options);
  ASSERT_EQ(constant.size(), 100u);
  EXPECT_EQ(constant[0], nanoseconds(0));
  EXPECT_NEAR(static_cast<double>(constant[99].count()), 0.99e9, 1e3);
  options.arrivals = Arrivals::kPoisson;
  options.rate = 10'000;
  const auto poisson = Times(options);
  // A Poisson count of 10000: 100 of standard deviation.
  EXPECT_NEAR(static_cast<double>(poisson.size()), 10'000, 500);
  EXPECT_TRUE(std::ranges::is_sorted(poisson));
  // Distances are exponential: their standard deviation is their mean.
  double sum = 0, squares = 0;
  for (std::size_t i = 1; i < poisson.size(); ++i) {
    const auto distance = static_cast<double>((poisson[i] - poisson[i - 1]).count());
    sum += distance, squares += distance * distance;
  }
  const double mean = sum / static_cast<double>(poisson.size() - 1);
  const double deviation =
      std::sqrt(squares / static_cast<double>(poisson.size() - 1) - mean * mean);
  EXPECT_NEAR(deviation / mean, 1, 0.1);
}

class LoadRunTest : public treelight::testing::ServerTest {
 protected:
  LoadResult Load(const LoadOptions& options) {
    MustBuild("cloud", treelight::testing::MakePhotons(100, 1));
    PhotonMapClient client(server_->InProcessChannel());
    client.SetRetryPatience({});
    return RunLoad(client, {.name = "cloud"}, options);
  }

  /// The same on a device that stands still for the first `pause`.
  LoadResult LoadBehindGate(std::chrono::milliseconds pause, const LoadOptions& options) {
    const auto gate = std::make_shared<treelight::testing::Gate>();
    Start(std::make_unique<treelight::testing::GatedBuilder>(gate));
    MustBuild("cloud", treelight::testing::MakePhotons(100, 1));
    PhotonMapClient client(server_->InProcessChannel());
    client.SetRetryPatience({});
    gate->open = false;
    std::jthread opener([&] {
      std::this_thread::sleep_for(pause);
      gate->open = true;
    });
    return RunLoad(client, {.name = "cloud"}, options);
  }
};

TEST_F(LoadRunTest, ClosedLoopSendsAsFastAsItIsAnswered) {
  Start();
  const auto result = Load(
      {.duration = 300ms, .workers = 2, .build_share = 0.25, .build_photons = 10, .queries = 5});
  const KindResult& gathers = result.kinds[0];
  const KindResult& builds = result.kinds[1];
  EXPECT_GT(gathers.sent, 4u);
  EXPECT_EQ(gathers.ok, gathers.sent);
  EXPECT_EQ(builds.ok, builds.sent);
  EXPECT_EQ(gathers.latency.count(), gathers.ok);
  EXPECT_EQ(result.late, 0u);
  // Every fourth request is a build.
  EXPECT_NEAR(static_cast<double>(builds.sent), static_cast<double>(result.sent()) / 4, 1);
}

TEST_F(LoadRunTest, OpenLoopSendsAllThatIsDueAndCountsFromThen) {
  // The device stands for half a second: two workers wait, and the rest of the requests are late.
  const auto result = LoadBehindGate(500ms, {.arrivals = Arrivals::kConstant,
                                             .rate = 100,
                                             .duration = 600ms,
                                             .workers = 2,
                                             .queries = 1});
  EXPECT_EQ(result.kinds[0].ok, 60u);
  EXPECT_GT(result.late, 30u);
  EXPECT_FALSE(result.IsSound(0.99));
  // The waiting of those that could not be sent counts too: a tool that counts from the send would
  // tell of two slow requests.
  EXPECT_GT(result.kinds[0].latency.Percentile(0.5), 200ms);
}

TEST_F(LoadRunTest, RefusalsAndFailuresAreCountedApart) {
  options_.queue_depth = 1;
  // While the device stands, one gather is on it, one waits, and there is no place for the others.
  const auto full = LoadBehindGate(300ms, {.arrivals = Arrivals::kConstant,
                                           .rate = 100,
                                           .duration = 200ms,
                                           .workers = 8,
                                           .queries = 1});
  const KindResult& gathers = full.kinds[0];
  EXPECT_EQ(gathers.sent, 20u);
  EXPECT_GE(gathers.refused, 10u);
  EXPECT_GE(gathers.ok, 1u);
  EXPECT_EQ(gathers.failed, 0u) << gathers.first_failure;
  EXPECT_EQ(gathers.sent, gathers.ok + gathers.refused);
  EXPECT_EQ(gathers.latency.count(), gathers.ok);

  PhotonMapClient client(server_->InProcessChannel());
  const auto missing =
      RunLoad(client, {.name = "missing"}, {.duration = 50ms, .workers = 1, .queries = 5});
  EXPECT_EQ(missing.kinds[0].ok, 0u);
  EXPECT_EQ(missing.kinds[0].refused, 0u);
  EXPECT_EQ(missing.kinds[0].failed, missing.kinds[0].sent);
  EXPECT_EQ(missing.kinds[0].first_failure.code(), absl::StatusCode::kNotFound);
}

TEST_F(LoadRunTest, AnInterruptEndsTheRunAndLeavesWhatWasMeasured) {
  Start();
  // The second request of the slower run is due after 100 s.
  for (const double rate : {100.0, 0.01}) {
    std::atomic<int> asked = 0;
    const auto begin = std::chrono::steady_clock::now();
    const auto result = Load({.arrivals = Arrivals::kConstant,
                              .rate = rate,
                              .duration = std::chrono::hours(1),
                              .workers = 2,
                              .queries = 1,
                              .interrupted = [&asked] { return ++asked > 20; }});
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(60));
    EXPECT_TRUE(result.interrupted);
    EXPECT_GT(result.kinds[0].ok, 0u);
    LoadRun run;
    run.options.rate = rate;
    run.result = result;
    EXPECT_EQ(LoadRows({run})[0][1], "closed (interrupted)");
  }
}

/// The row of a run with `ok` gathers that were answered, `late` of which were sent late.
std::map<std::string, std::string> RowOf(std::uint64_t ok, std::uint64_t late) {
  LoadRun run;
  run.options.arrivals = Arrivals::kConstant;
  run.options.rate = 10;
  KindResult& gathers = run.result.kinds[0];
  gathers.sent = gathers.ok = ok;
  for (std::uint64_t i = 0; i < ok; ++i) gathers.latency.Record(1ms);
  run.result.late = late;
  run.result.seconds = 1;
  const auto rows = LoadRows({run});
  std::map<std::string, std::string> row;
  for (std::size_t i = 0; i < LoadColumns().size(); ++i) row[LoadColumns()[i]] = rows[0][i];
  return row;
}

TEST(LoadTest, ATailThatSaysNothingIsNotTold) {
  // Of 1000 sends at most one may be late for a p99.9, ten for a p99.
  for (const auto& [late, p99, p999] : {std::tuple{0, true, true},
                                        {1, true, true},
                                        {2, true, false},
                                        {10, true, false},
                                        {11, false, false}}) {
    const auto row = RowOf(1000, static_cast<std::uint64_t>(late));
    EXPECT_EQ(!row.at("p99_ms").empty(), p99) << late;
    EXPECT_EQ(!row.at("p999_ms").empty(), p999) << late;
    EXPECT_FALSE(row.at("p50_ms").empty());
  }
  for (const auto& [ok, p99, p999] :
       {std::tuple{99, false, false}, {100, true, false}, {999, true, false}, {1000, true, true}}) {
    const auto row = RowOf(static_cast<std::uint64_t>(ok), 0);
    EXPECT_EQ(!row.at("p99_ms").empty(), p99) << ok;
    EXPECT_EQ(!row.at("p999_ms").empty(), p999) << ok;
    EXPECT_FALSE(row.at("p90_ms").empty());
    EXPECT_FALSE(row.at("max_ms").empty());
  }
}

}  // namespace
}  // namespace treelight::client
