#include "core/cpu/simd/packed_search.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include "core/builder.h"
#include "core/cpu/tree_gatherer.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tbb/task_arena.h"
#include "tests/answers.h"
#include "tests/clouds.h"

namespace treelight {
namespace {

constexpr float kUnlimited = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kExact = kOutputCount | kOutputRadius | kOutputNeighbors;

/// Each kind of instructions that this processor has.
class PackedSearchTest : public testing::TestWithParam<Instructions> {
 protected:
  /// The map of `builder`'s tree, searched by the instructions under test.
  static std::unique_ptr<Gatherer> Make(const Photons& photons, const BuildOptions& options) {
    const auto map = *MakeCpuBuilder()->Build(photons, options);
    return MakeTreeGatherer(photons, *map->ReadTree(), map->report(), GetParam());
  }
};

void ExpectSame(const Gatherer& map, const Gatherer& expected, const GatherQueries& queries,
                const GatherOptions& options) {
  const auto e = expected.Gather(queries, options);
  const auto a = map.Gather(queries, options);
  ASSERT_TRUE(e.ok()) << e.status();
  ASSERT_TRUE(a.ok()) << a.status();
  EXPECT_TRUE(SameExactAnswers(*a, *e)) << "k " << options.k << ", radius " << options.radius;
  ASSERT_EQ(a->densities.size(), e->densities.size());
  for (std::size_t i = 0; i < a->densities.size(); ++i) {
    ASSERT_NEAR(a->densities[i], e->densities[i], 1e-6f * std::fabs(e->densities[i]))
        << i << ", k " << options.k;
  }
}

TEST_P(PackedSearchTest, FindsWhatBruteForceFindsInEveryCloud) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE(seed);
  for (const CloudShape& shape : AllClouds()) {
    SCOPED_TRACE(shape.name);
    for (const std::size_t count : {0, 1, 2, 31, 33, 1000, 5003}) {
      const Photons photons = MakeCloud(shape, count, seed);
      const auto brute = *MakeBruteForceBuilder()->Build(photons, {});
      const auto map = Make(photons, {.max_leaf_size = count % 2 == 0 ? 64u : 3u});
      // Enough of them to be sorted, and too few.
      const auto positions = MakeQueries(photons, count < 5000 ? 300 : 40, seed);
      const GatherQueries queries{.positions = positions};
      const float radius = MedianRadius(*brute, queries, 20);
      for (const std::uint32_t k : {1u, 2u, 8u, 50u, 257u, 1000u}) {
        ExpectSame(*map, *brute, queries, {.k = k, .radius = kUnlimited, .outputs = kExact});
        ExpectSame(*map, *brute, queries, {.k = k, .radius = radius, .outputs = kExact});
      }
      for (const float r : {0.0f, radius, 2 * radius}) {
        ExpectSame(*map, *brute, queries, {.k = 0, .radius = r, .outputs = kExact});
        ExpectSame(*map, *brute, queries, {.k = 0, .radius = r, .outputs = kOutputCount});
      }
    }
  }
}

TEST_P(PackedSearchTest, EstimatesTheDensityOfBruteForce) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 5003, /*seed=*/3);
  const auto brute = *MakeBruteForceBuilder()->Build(photons, {});
  const auto map = Make(photons, {});
  const auto positions = MakeQueries(photons, 300, /*seed=*/4);
  std::vector<float> normals(positions.size(), 0);
  for (std::size_t i = 0; i < normals.size(); i += 3) normals[i + i / 3 % 3] = 1;
  const GatherQueries queries{.positions = positions},
      facing{.positions = positions, .normals = normals};
  const float radius = MedianRadius(*brute, queries, 50);
  for (const auto kernel :
       {DensityKernel::kConstant, DensityKernel::kCone, DensityKernel::kEpanechnikov}) {
    for (const std::uint32_t k : {0u, 50u}) {
      const GatherOptions options{
          .k = k, .radius = radius, .outputs = kOutputDensity | kOutputCount, .kernel = kernel};
      ExpectSame(*map, *brute, queries, options);
      ExpectSame(*map, *brute, facing, options);
    }
  }
}

TEST_P(PackedSearchTest, RadiiOfTheQueriesAndCapsAreKept) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 3001, /*seed=*/5);
  const auto brute = *MakeBruteForceBuilder()->Build(photons, {});
  const auto map = Make(photons, {});
  const auto positions = MakeQueries(photons, 300, /*seed=*/6);
  std::vector<float> radii(300);
  const float radius = MedianRadius(*brute, {.positions = positions}, 50);
  for (std::size_t i = 0; i < radii.size(); ++i) radii[i] = radius * static_cast<float>(i % 7) / 3;
  const GatherQueries queries{.positions = positions, .radii = radii};
  for (const std::uint32_t k : {0u, 1u, 50u}) {
    ExpectSame(*map, *brute, queries, {.k = k, .outputs = kExact});
  }
  const auto counts = map->Gather(queries, {.k = 0, .outputs = kOutputCount})->counts;
  std::uint64_t total = 0;
  for (const std::uint32_t count : counts) total += count;
  GatherOptions lists{.k = 0, .outputs = kOutputNeighbors, .max_neighbors = total};
  EXPECT_TRUE(map->Gather(queries, lists).ok());
  lists.max_neighbors = total - 1;
  EXPECT_EQ(map->Gather(queries, lists).status().code(), absl::StatusCode::kResourceExhausted);
}

TEST_P(PackedSearchTest, TheAnswersAreTheSameBitsForAnyNumberOfThreads) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 20011, /*seed=*/7);
  const auto map = Make(photons, {});
  const auto positions = MakeQueries(photons, 3000, /*seed=*/8);
  const GatherOptions options{.k = 50, .outputs = kExact | kOutputDensity};
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, 4);
  const auto gather = [&](int threads) {
    return *tbb::task_arena(threads).execute(
        [&] { return map->Gather({.positions = positions}, options); });
  };
  const GatherResult one = gather(1), four = gather(4);
  EXPECT_TRUE(SameExactAnswers(one, four));
  EXPECT_EQ(one.densities, four.densities);
}

// Queries that come one after the other bound each other's search; between these, distances
// underflow or are large.
TEST_P(PackedSearchTest, QueriesFarFromEachOtherAndTinyDistances) {
  Photons photons;
  for (int i = 0; i < 2000; ++i) {
    const float scale = i % 2 == 0 ? 1e-22f : 5e16f;
    photons.positions.insert(photons.positions.end(), {static_cast<float>(i * 7 % 13) * scale,
                                                       static_cast<float>(i % 5) * scale,
                                                       static_cast<float>(i * 3 % 11) * scale});
  }
  const auto brute = *MakeBruteForceBuilder()->Build(photons, {});
  const auto map = Make(photons, {});
  for (const std::uint32_t k : {1u, 50u, 999u}) {
    ExpectSame(*map, *brute, {.positions = photons.positions}, {.k = k, .outputs = kExact});
  }
}

TEST_P(PackedSearchTest, TheLargestKAndTheLargestRadius) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 5003, /*seed=*/9);
  const auto brute = *MakeBruteForceBuilder()->Build(photons, {});
  const auto map = Make(photons, {});
  const auto positions = MakeQueries(photons, 9, /*seed=*/10);
  const GatherQueries queries{.positions = positions};
  ExpectSame(*map, *brute, queries, {.k = kMaxNeighbors, .outputs = kExact});
  for (const std::uint32_t outputs : {kExact, kOutputCount | kOutputDensity}) {
    ExpectSame(*map, *brute, queries, {.k = 0, .radius = 1e30f, .outputs = outputs});
  }
}

TEST_P(PackedSearchTest, QueriesFarFromPhotonsAtOnePlace) {
  Photons photons;
  for (int i = 0; i < 100; ++i) photons.positions.insert(photons.positions.end(), {0, 0, 0});
  const auto brute = *MakeBruteForceBuilder()->Build(photons, {});
  const auto map = Make(photons, {});
  std::vector<float> positions(3 * 300, 0);
  for (std::size_t i = 0; i < positions.size(); i += 2) positions[i] = i % 4 == 0 ? 1e18f : -5e9f;
  ExpectSame(*map, *brute, {.positions = positions}, {.k = 8, .outputs = kExact});
}

TEST_P(PackedSearchTest, ManyEqualPhotonsAreNotAllLookedAt) {
  Photons photons;
  for (int i = 0; i < 400000; ++i) photons.positions.insert(photons.positions.end(), {1, 2, 3});
  const auto map = Make(photons, {});
  const std::vector<float> positions(3 * 1000, 1.0f);
  const auto result = map->Gather({.positions = positions}, {.k = 50, .outputs = kOutputNeighbors});
  ASSERT_TRUE(result.ok()) << result.status();  // at once; all photons for each would be minutes
  for (std::uint32_t i = 0; i < 50; ++i) EXPECT_EQ(result->neighbor_ids[i], i);
}

TEST_P(PackedSearchTest, CancelsAtOnceAndBetweenTasks) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 3001, /*seed=*/5);
  const auto map = Make(photons, {});
  for (const int asked_before : {0, 2}) {
    for (const std::uint32_t k : {0u, 8u, 200u}) {
      std::atomic<int> asked = 0;
      const auto stop = [&] { return ++asked > asked_before; };
      const auto result =
          map->Gather({.positions = photons.positions}, {.k = k, .radius = 1}, stop);
      EXPECT_EQ(result.status().code(), absl::StatusCode::kCancelled) << k;
      EXPECT_LE(asked, asked_before + 3) << k;  // one more by each thread
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Instructions, PackedSearchTest, testing::ValuesIn(SupportedInstructions()),
                         [](const auto& test) {
                           std::string name(NameOf(test.param));
                           std::erase_if(name, [](char c) { return std::isalnum(c) == 0; });
                           return name;
                         });

}  // namespace
}  // namespace treelight
