// Gathers of about the k nearest: what they promise, against brute force, on every cloud and kind
// of search.

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "core/builder.h"
#include "core/cpu/tree_gatherer.h"
#include "core/gatherer.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tbb/task_arena.h"
#include "tests/answers.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr float kUnlimited = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kLists = kOutputCount | kOutputRadius | kOutputNeighbors;

/// The squared distances of query `i`, found ones alone.
std::vector<float> DistancesOf(const GatherResult& answer, std::uint32_t k, std::size_t i) {
  const auto first = answer.neighbor_squared_distances.begin() + static_cast<std::ptrdiff_t>(i * k);
  return {first, first + answer.counts[i]};
}

/// The `k` smallest squared distances of photons to a point, in float64.
std::vector<double> NearestInDouble(const Photons& photons, const float* point, std::size_t k) {
  std::vector<double> squares;
  for (std::size_t i = 0; i < photons.size(); ++i) {
    double d2 = 0;
    for (int c = 0; c < 3; ++c) {
      const double d = double{point[c]} - photons.positions[3 * i + static_cast<std::size_t>(c)];
      d2 += d * d;
    }
    squares.push_back(d2);
  }
  std::partial_sort(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(k),
                    squares.end());
  squares.resize(k);
  return squares;
}

/// `answer` keeps what it promises, where `exact` is the truth: bounds of each query hold at every
/// rank, and none is above `largest_bound`.
void ExpectBounded(const GatherResult& answer, const GatherResult& exact, std::uint32_t k,
                   double largest_bound) {
  ASSERT_EQ(answer.error_bounds.size(), exact.counts.size());
  for (std::size_t i = 0; i < exact.counts.size(); ++i) {
    const double bound = answer.error_bounds[i];
    ASSERT_LE(bound, largest_bound) << "query " << i;
    ASSERT_GE(bound, 0) << "query " << i;
    ASSERT_LE(answer.counts[i], exact.counts[i]) << "query " << i;
    if (std::isinf(bound)) continue;
    ASSERT_EQ(answer.counts[i], exact.counts[i]) << "query " << i;
    const auto found = DistancesOf(answer, k, i), truth = DistancesOf(exact, k, i);
    ASSERT_TRUE(std::is_sorted(found.begin(), found.end()));
    for (std::size_t rank = 0; rank < found.size(); ++rank) {
      ASSERT_GE(found[rank], truth[rank]);
      ASSERT_LE(found[rank], (1 + bound) * (1 + bound) * truth[rank])
          << "query " << i << ", rank " << rank;
    }
    if (bound == 0) {
      ASSERT_EQ(found, truth) << "query " << i;
    }
    if (found.size() == k) {
      ASSERT_EQ(answer.radii[i], std::sqrt(found.back()));
    }
  }
}

/// All ways to search the same photons.
struct Searches {
  std::unique_ptr<Gatherer> brute_force, device;
  std::vector<std::unique_ptr<Gatherer>> packed;  ///< by each kind of instructions

  explicit Searches(const Photons& photons, const BuildOptions& options = {.max_leaf_size = 8})
      : brute_force(*MakeBruteForceBuilder()->Build(photons, {})),
        device(*TestBuilder().Build(photons, options)) {
    const Tree tree = *device->ReadTree();
    for (const Instructions instructions : SupportedInstructions()) {
      packed.push_back(MakeTreeGatherer(photons, tree, {}, instructions));
    }
  }

  /// Calls `check` with each answer to `options`, by the plain search of the CPU too.
  void ForEach(const GatherQueries& queries, GatherOptions options,
               const std::function<void(const GatherResult&)>& check) const {
    const auto answer = [&](const Gatherer& map) {
      const auto result = map.Gather(queries, options);
      ASSERT_TRUE(result.ok()) << result.status();
      check(*result);
    };
    for (const auto& map : packed) answer(*map);
    answer(*device);
    options.outputs |= kOutputStatistics;
    answer(*packed.front());
    answer(*device);
  }
};

class EveryCloud : public testing::TestWithParam<std::string> {};

TEST_P(EveryCloud, DistancesAreWithinEpsilonOfTheTrueOnes) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE(seed);
  for (const std::size_t size : {0, 1, 33, 2003}) {
    const Photons photons = MakeCloud(CloudNamed(GetParam()), size, seed);
    const Searches searches(photons);
    const auto positions = MakeQueries(photons, 260, seed);  // enough to be sorted
    const GatherQueries queries{.positions = positions};
    const float radius = MedianRadius(*searches.brute_force, queries, 20);
    for (const std::uint32_t k : {1u, 8u, 50u}) {
      for (const float r : {kUnlimited, radius, 0.0f}) {
        const GatherOptions exact{.k = k, .radius = r, .outputs = kLists};
        const auto truth = *searches.brute_force->Gather(queries, exact);
        for (const float epsilon : {1e-6f, 0.1f, 1.0f, 10.0f}) {
          GatherOptions about = exact;
          about.approximation = {.epsilon = epsilon};
          SCOPED_TRACE(testing::Message() << "size " << size << ", k " << k << ", radius " << r
                                          << ", epsilon " << epsilon);
          searches.ForEach(queries, about, [&](const GatherResult& answer) {
            ExpectBounded(answer, truth, k, epsilon + 1e-6);
          });
        }
      }
    }
  }
}

TEST_P(EveryCloud, ABudgetOfLeavesTellsHowFarItIsFromTheTruth) {
  const Photons photons = MakeCloud(CloudNamed(GetParam()), 5003, /*seed=*/7);
  const Searches searches(photons);
  const auto positions = MakeQueries(photons, 97, /*seed=*/8);
  const GatherQueries queries{.positions = positions};
  for (const std::uint32_t k : {1u, 50u}) {
    const GatherOptions exact{.k = k, .outputs = kLists};
    const auto truth = *searches.brute_force->Gather(queries, exact);
    for (const std::uint32_t leaves : {1u, 3u, 20u, 5003u}) {
      GatherOptions about = exact;
      for (const float epsilon : {0.0f, 0.3f}) {
        about.approximation = {.epsilon = epsilon, .max_leaves = leaves};
        SCOPED_TRACE(testing::Message() << "k " << k << ", leaves " << leaves);
        searches.ForEach(queries, about, [&](const GatherResult& answer) {
          ExpectBounded(answer, truth, k, leaves < photons.size() ? kUnlimited : epsilon + 1e-6);
          if (answer.distance_tests.empty()) return;
          // Leaves hold at most 8 unless all of a leaf's photons are at one place.
          if (GetParam() != "uniform") return;
          for (const std::uint32_t tests : answer.distance_tests) ASSERT_LE(tests, 8 * leaves);
        });
      }
    }
  }
}

TEST_P(EveryCloud, TheDeviceAnswersAsThePlainSearchDoes) {
  const Photons photons = MakeCloud(CloudNamed(GetParam()), 3001, /*seed=*/7);
  const Searches searches(photons);
  const auto positions = MakeQueries(photons, 97, /*seed=*/8);
  const GatherQueries queries{.positions = positions};
  for (const Approximation& approximation :
       {Approximation{.epsilon = 0.2f}, Approximation{.max_leaves = 5},
        Approximation{.epsilon = 0.5f, .max_leaves = 9}}) {
    for (const std::uint32_t k : {1u, 50u, 700u}) {  // heaps in local and in global memory
      const GatherOptions options{
          .k = k, .outputs = kLists | kOutputStatistics, .approximation = approximation};
      const auto plain = *searches.packed.front()->Gather(queries, options);
      const auto device = *searches.device->Gather(queries, options);
      ASSERT_TRUE(SameExactAnswers(device, plain)) << k;
      ASSERT_EQ(device.error_bounds, plain.error_bounds) << k;
      ASSERT_EQ(device.nodes_visited, plain.nodes_visited) << k;
      ASSERT_EQ(device.distance_tests, plain.distance_tests) << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Clouds, EveryCloud, testing::ValuesIn(CloudNames()),
                         [](const auto& test) { return test.param; });

// Each distance in float32 is within 5 roundings of that in float64, the true k-th one too.
TEST(ApproximateNearestTest, DistancesAreWithinEpsilonOfFloat64) {
  constexpr std::uint32_t kCount = 50;
  constexpr double kEpsilon = 0.25;
  for (const std::string name : {"uniform", "surfaces", "offset_million", "huge"}) {
    const Photons photons = MakeCloud(CloudNamed(name), 20011, /*seed=*/7);
    const Searches searches(photons);
    const auto positions = MakeQueries(photons, 31, /*seed=*/8);
    const GatherOptions options{
        .k = kCount, .outputs = kLists, .approximation = {.epsilon = static_cast<float>(kEpsilon)}};
    searches.ForEach({.positions = positions}, options, [&](const GatherResult& answer) {
      for (std::size_t q = 0; q < 31; ++q) {
        const auto truth = NearestInDouble(photons, &positions[3 * q], kCount);
        const auto found = DistancesOf(answer, kCount, q);
        for (std::size_t rank = 0; rank < kCount; ++rank) {
          ASSERT_LE(found[rank], (1 + kEpsilon) * (1 + kEpsilon) * truth[rank] * (1 + 10 * 0x1p-24))
              << name;
        }
      }
    });
  }
}

TEST(ApproximateNearestTest, LooksAtFewerPhotonsTheMoreItMayErr) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 20011, /*seed=*/7);
  const Searches searches(photons);
  const auto positions = MakeQueries(photons, 100, /*seed=*/8);
  double last = std::numeric_limits<double>::infinity();
  for (const float epsilon : {0.0f, 0.2f, 1.0f, 4.0f}) {
    const auto answer = *searches.device->Gather(
        {.positions = positions},
        {.k = 20, .outputs = kOutputStatistics, .approximation = {.epsilon = epsilon}});
    double tests = 0;
    for (const std::uint32_t count : answer.distance_tests) tests += count;
    EXPECT_LT(tests, 0.95 * last) << epsilon;
    last = tests;
  }
}

TEST(ApproximateNearestTest, ExactRequestsHaveNoBounds) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 1009, /*seed=*/7);
  const Searches searches(photons);
  searches.ForEach({.positions = std::span(photons.positions).first(30)},
                   {.k = 5, .outputs = kLists},
                   [](const GatherResult& answer) { EXPECT_TRUE(answer.error_bounds.empty()); });
}

// The worked example of a skipped leaf: two photons, leaves of one, the query nearer to the second.
TEST(ApproximateNearestTest, AWorkedExample) {
  Photons photons;
  photons.positions = {0, 0, 0, 10, 0, 0, 11, 0, 0};
  const Searches searches(photons, {.max_leaf_size = 1});
  const std::vector<float> positions = {6, 0, 0};
  // By one leaf the photon at 10 is found, 4 away; what was left out is 5 away or farther: exact.
  GatherOptions options{.k = 1, .outputs = kLists, .approximation = {.max_leaves = 1}};
  options.outputs |= kOutputStatistics;
  const auto one = *searches.device->Gather({.positions = positions}, options);
  EXPECT_EQ(one.neighbor_ids, (std::vector<std::uint32_t>{1}));
  EXPECT_EQ(one.error_bounds, (std::vector<float>{0}));
  // Of two neighbours by one leaf nothing is known of the second.
  options.k = 2;
  const auto two = *searches.device->Gather({.positions = positions}, options);
  EXPECT_EQ(two.counts, (std::vector<std::uint32_t>{1}));
  EXPECT_EQ(two.error_bounds, (std::vector<float>{kUnlimited}));
  // By two leaves the photons 4 and 5 away are found; the last is 6 away.
  options.approximation.max_leaves = 2;
  const auto both = *searches.device->Gather({.positions = positions}, options);
  EXPECT_EQ(both.neighbor_squared_distances, (std::vector<float>{16, 25}));
  EXPECT_EQ(both.error_bounds, (std::vector<float>{0}));
}

TEST(ApproximateNearestTest, TheAnswersAreTheSameBitsForAnyNumberOfThreads) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 20011, /*seed=*/7);
  const auto map = *MakeCpuBuilder()->Build(photons, {});
  const auto positions = MakeQueries(photons, 3000, /*seed=*/8);
  const GatherOptions options{.k = 50,
                              .outputs = kLists | kOutputDensity,
                              .approximation = {.epsilon = 0.5f, .max_leaves = 12}};
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, 4);
  const auto gather = [&](int threads) {
    return *tbb::task_arena(threads).execute(
        [&] { return map->Gather({.positions = positions}, options); });
  };
  const GatherResult one = gather(1), four = gather(4);
  EXPECT_TRUE(SameExactAnswers(one, four));
  EXPECT_EQ(one.densities, four.densities);
  EXPECT_EQ(one.error_bounds, four.error_bounds);
}

}  // namespace
}  // namespace treelight
