#include "client/load/latency_histogram.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using std::chrono::nanoseconds;

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

TEST(LatencyHistogramTest, ThoseOfThreadsAddUp) {
  LatencyHistogram sum;
  std::mutex mutex;  // guards `sum`
  {
    std::vector<std::jthread> threads;
    for (int thread = 0; thread < 4; ++thread) {
      threads.emplace_back([&, thread] {
        LatencyHistogram own;
        for (int ns = thread; ns < 100'000; ns += 4) own.Record(nanoseconds(ns));
        const std::lock_guard lock(mutex);
        sum.Add(own);
      });
    }
  }
  EXPECT_EQ(sum.count(), 100'000u);
  EXPECT_NEAR(static_cast<double>(sum.Percentile(0.5).count()), 50'000, 500);
}

}  // namespace
}  // namespace treelight::client
