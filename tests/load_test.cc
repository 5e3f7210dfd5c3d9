#include <chrono>
#include <cmath>
#include <memory>
#include <random>
#include <thread>
#include <vector>

#include "client/load/latency_histogram.h"
#include "client/load/load_run.h"
#include "gtest/gtest.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

using std::chrono::nanoseconds;
using std::chrono_literals::operator""ms;

TEST(LatencyHistogramTest, PercentilesAreWithinABucketOfSortedOnes) {
  std::mt19937_64 engine(7);
  std::lognormal_distribution<double> spread(13, 3);  // from microseconds to minutes
  std::vector<std::int64_t> sorted;
  LatencyHistogram histogram, part;
  for (int i = 0; i < 20'000; ++i) {
    const auto ns = static_cast<std::int64_t>(spread(engine));
    sorted.push_back(ns);
    (i % 2 == 0 ? histogram : part).Record(nanoseconds(ns));
  }
  histogram.Add(part);
  std::ranges::sort(sorted);
  EXPECT_EQ(histogram.count(), sorted.size());
  EXPECT_EQ(histogram.max().count(), sorted.back());
  for (const double fraction : {0.0, 0.001, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank = std::max<std::size_t>(1, std::ceil(fraction * sorted.size()));
    const double exact = static_cast<double>(sorted[rank - 1]);
    const auto told = static_cast<double>(histogram.Percentile(fraction).count());
    EXPECT_GE(told, exact) << fraction;
    EXPECT_LE(told, exact * (1 + 1.0 / 128) + 1) << fraction;
  }
}

TEST(LatencyHistogramTest, SmallNumbersAreExactAndNoneIsZero) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.Percentile(0.5), nanoseconds(0));
  for (int ns = -1; ns < 256; ++ns) histogram.Record(nanoseconds(ns));
  EXPECT_EQ(histogram.Percentile(1), nanoseconds(255));
  EXPECT_EQ(histogram.Percentile(129.0 / 257), nanoseconds(127));
}

TEST(LoadTest, IntendedTimesHaveTheRate) {
  LoadOptions options{.arrivals = Arrivals::kConstant, .rate = 100, .duration = 1000ms};
  const auto constant = IntendedTimes(options);
  ASSERT_EQ(constant.size(), 100u);
  EXPECT_EQ(constant[0], nanoseconds(0));
  EXPECT_NEAR(static_cast<double>(constant[99].count()), 0.99e9, 1e3);
  options.arrivals = Arrivals::kPoisson;
  options.rate = 10'000;
  const auto poisson = IntendedTimes(options);
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
  const auto gate = std::make_shared<treelight::testing::Gate>();
  Start(std::make_unique<treelight::testing::GatedBuilder>(gate));
  MustBuild("cloud", treelight::testing::MakePhotons(100, 1));
  PhotonMapClient client(server_->InProcessChannel());
  gate->open = false;
  std::jthread opener([&] {
    std::this_thread::sleep_for(500ms);
    gate->open = true;
  });
  // The device stands for half a second: two workers wait, and the rest of the requests are late.
  const auto result = RunLoad(client, {.name = "cloud"},
                              {.arrivals = Arrivals::kConstant,
                               .rate = 100,
                               .duration = 600ms,
                               .workers = 2,
                               .queries = 1});
  EXPECT_EQ(result.kinds[0].ok, 60u);
  EXPECT_GT(result.late, 30u);
  EXPECT_FALSE(result.tail_is_sound());
  // The waiting of those that could not be sent counts too: a tool that counts from the send would
  // tell of two slow requests.
  EXPECT_GT(result.kinds[0].latency.Percentile(0.5), 200ms);
}

TEST_F(LoadRunTest, RefusalsAndFailuresAreCountedApart) {
  options_.limits.max_queries = 10;
  Start();
  PhotonMapClient client(server_->InProcessChannel());
  const auto result =
      RunLoad(client, {.name = "missing"}, {.duration = 50ms, .workers = 1, .queries = 5});
  EXPECT_EQ(result.kinds[0].ok, 0u);
  EXPECT_EQ(result.kinds[0].failed, result.kinds[0].sent);
  EXPECT_EQ(result.kinds[0].first_failure.code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace treelight::client
