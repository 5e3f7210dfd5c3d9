#include "core/gatherer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "core/builder.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/map_pair.h"

namespace treelight {
namespace {

constexpr std::uint32_t kExact = kOutputCount | kOutputRadius | kOutputNeighbors;
constexpr float kUnlimited = std::numeric_limits<float>::infinity();

/// Both answers, which must hold the same bits but for densities. Returns the device's.
GatherResult ExpectSameAnswers(const MapPair& pair, const GatherQueries& queries,
                               const GatherOptions& options) {
  const auto actual = pair.device->Gather(queries, options);
  const auto expected = pair.brute_force->Gather(queries, options);
  EXPECT_TRUE(actual.ok()) << actual.status();
  EXPECT_TRUE(expected.ok()) << expected.status();
  EXPECT_TRUE(SameExactAnswers(*actual, *expected));
  return *actual;
}

class EveryCloud : public testing::TestWithParam<std::string> {};

TEST_P(EveryCloud, AnswersAreBitEqualToBruteForce) {
  for (const std::size_t size : {0, 1, 2, 17, 257, 20011}) {
    const Photons photons = MakeCloud(CloudNamed(GetParam()), size, /*seed=*/7);
    for (const BuildOptions& options :
         {BuildOptions{}, BuildOptions{BuilderKind::kLbvh, MortonBits::k63, 5}}) {
      const MapPair pair = BuildPair(photons, options);
      const auto positions = MakeQueries(photons, 97, /*seed=*/8);
      const GatherQueries queries{positions, {}, {}};
      const float radius = MedianRadius(*pair.brute_force, queries, 10);
      SCOPED_TRACE("size " + std::to_string(size));
      for (const std::uint32_t k : {1u, 8u, 50u}) {
        for (const float r : {kUnlimited, radius, 0.0f}) {
          ExpectSameAnswers(pair, queries, {.k = k, .radius = r, .outputs = kExact});
        }
      }
      for (const float r : {radius, 0.0f}) {
        ExpectSameAnswers(pair, queries, {.k = 0, .radius = r, .outputs = kExact});
        ExpectSameAnswers(pair, queries, {.k = 0, .radius = r, .outputs = kOutputCount});
      }
    }
  }
}

TEST_P(EveryCloud, DensitiesAreWithinTheStatedBound) {
  const Photons photons = MakeCloud(CloudNamed(GetParam()), 20011, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const auto positions = MakeQueries(photons, 97, /*seed=*/8);
  const auto normals = MakeQueries(photons, 97, /*seed=*/9);
  const GatherQueries plain{positions, {}, {}}, with_normals{positions, normals, {}};
  const float radius = MedianRadius(*pair.brute_force, plain, 50);
  for (const DensityKernel kernel :
       {DensityKernel::kConstant, DensityKernel::kCone, DensityKernel::kEpanechnikov}) {
    for (const GatherQueries& queries : {plain, with_normals}) {
      for (const std::uint32_t k : {0u, 50u, 200u}) {
        const GatherOptions options{.k = k,
                                    .radius = k > 50 ? 2 * radius : radius,
                                    .outputs = kOutputCount | kOutputRadius | kOutputDensity,
                                    .kernel = kernel};
        const GatherResult actual = ExpectSameAnswers(pair, queries, options);
        ExpectCloseDensities(actual, *pair.brute_force->Gather(queries, options), photons, kernel);
      }
    }
  }
}

TEST(GathererTest, ADensityOfManyPhotonsIsAsPreciseAsOneOfFew) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 300007, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const auto positions = MakeQueries(photons, 3, /*seed=*/8);
  for (const float tolerance : {0.0f, 0.001f}) {
    const GatherOptions options{.k = 0,
                                .radius = 0.7f,
                                .outputs = kOutputCount | kOutputRadius | kOutputDensity,
                                .kernel = DensityKernel::kEpanechnikov,
                                .approximation = {.weight_tolerance = tolerance}};
    const auto actual = pair.device->Gather({positions, {}, {}}, options);
    const auto expected = pair.brute_force->Gather({positions, {}, {}}, options);
    ASSERT_TRUE(actual.ok() && expected.ok());
    ASSERT_GT(expected->counts[0], 100000u);
    ExpectCloseDensities(*actual, *expected, photons, options.kernel);
  }
}

INSTANTIATE_TEST_SUITE_P(Clouds, EveryCloud, testing::ValuesIn(CloudNames()),
                         [](const auto& test) { return test.param; });

TEST(GathererTest, PhotonsComeBackInTheOrderOfUpload) {
  for (const std::size_t size : {0, 1, 1009}) {
    const Photons photons = MakeCloud(CloudNamed("surfaces"), size, /*seed=*/7);
    const auto map = TestBuilder().Build(photons, {});
    ASSERT_TRUE(map.ok()) << map.status();
    const auto back = (*map)->ReadPhotons();
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(back->positions, photons.positions);
    EXPECT_EQ(back->powers, photons.powers);
    EXPECT_EQ(back->directions, photons.directions);
  }
  const auto bare =
      TestBuilder().Build({.positions = {1, 2, 3}, .powers = {}, .directions = {}}, {});
  EXPECT_EQ((*bare)->ReadPhotons()->positions, (std::vector<float>{1, 2, 3}));
  EXPECT_TRUE((*bare)->ReadPhotons()->powers.empty());
}

TEST(GathererTest, ManyQueriesInOneBatch) {
  // Sorted on the device, and more than one launch.
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 3001, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const auto positions = MakeQueries(photons, 40009, /*seed=*/8);
  ExpectSameAnswers(pair, {positions, {}, {}}, {.k = 5, .outputs = kExact});
  ExpectSameAnswers(pair, {positions, {}, {}}, {.k = 0, .radius = 0.01f, .outputs = kExact});
}

TEST(GathererTest, LargeKUsesHeapsInGlobalMemory) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 20011, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const auto positions = MakeQueries(photons, 61, /*seed=*/8);
  for (const std::uint32_t k : {100u, 513u, 1000u, kMaxNeighbors}) {
    ExpectSameAnswers(pair, {positions, {}, {}}, {.k = k, .outputs = kExact});
  }
}

TEST(GathererTest, ARadiusForEachQuery) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 20011, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const auto positions = MakeQueries(photons, 97, /*seed=*/8);
  std::vector<float> radii;
  for (int i = 0; i < 97; ++i) radii.push_back(0.002f * static_cast<float>(i));
  ExpectSameAnswers(pair, {positions, {}, radii}, {.k = 0, .outputs = kExact});
  radii[3] = kUnlimited;
  ExpectSameAnswers(pair, {positions, {}, radii}, {.k = 20, .outputs = kExact});
}

// The k-th distance in float32 is within 5 roundings of the k-th in float64, since every distance
// is.
TEST(GathererTest, DistancesAreWithinTheStatedBoundOfFloat64) {
  for (const std::string name : {"uniform", "surfaces", "offset_million", "huge"}) {
    const Photons photons = MakeCloud(CloudNamed(name), 20011, /*seed=*/7);
    const auto map = TestBuilder().Build(photons, {});
    const auto positions = MakeQueries(photons, 31, /*seed=*/8);
    const auto answer = (*map)->Gather({positions, {}, {}}, {.k = 50, .outputs = kOutputNeighbors});
    ASSERT_TRUE(answer.ok()) << answer.status();
    for (std::size_t q = 0; q < 31; ++q) {
      std::vector<double> exact;
      for (std::size_t i = 0; i < photons.size(); ++i) {
        double d2 = 0;
        for (int c = 0; c < 3; ++c) {
          const double d = double{positions[3 * q + c]} - photons.positions[3 * i + c];
          d2 += d * d;
        }
        exact.push_back(d2);
      }
      std::partial_sort(exact.begin(), exact.begin() + 50, exact.end());
      for (std::size_t j = 0; j < 50; ++j) {
        ASSERT_NEAR(answer->neighbor_squared_distances[50 * q + j], exact[j],
                    5 * 0x1p-24 * exact[j])
            << name;
      }
    }
  }
}

TEST(GathererTest, AFreshBatchIsBitEqualToBruteForce) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  for (const CloudShape& shape : AllClouds()) {
    SCOPED_TRACE(shape.name);
    const Photons photons = MakeCloud(shape, 500 + seed % 3000, seed);
    const MapPair pair = BuildPair(photons);
    const auto positions = MakeQueries(photons, 50, seed + 1);
    ExpectSameAnswers(pair, {positions, {}, {}}, {.k = 1 + seed % 60, .outputs = kExact});
  }
}

TEST(GathererTest, DuplicatesDoNotCostVisits) {
  // 20011 photons at one place: ties fall to the smaller index without visiting them all.
  const Photons photons = MakeCloud(CloudNamed("all_equal"), 20011, /*seed=*/7);
  const auto map = TestBuilder().Build(photons, {});
  const std::vector<float> positions(photons.positions.begin(), photons.positions.begin() + 3);
  const auto answer = (*map)->Gather({positions, {}, {}},
                                     {.k = 50, .radius = 0, .outputs = kExact | kOutputStatistics});
  ASSERT_TRUE(answer.ok()) << answer.status();
  for (std::uint32_t i = 0; i < 50; ++i) EXPECT_EQ(answer->neighbor_ids[i], i);
  EXPECT_LT(answer->nodes_visited[0], 40u);
  EXPECT_LT(answer->distance_tests[0], 100u);
}

TEST(GathererTest, WholeSubtreesAreCounted) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 20011, /*seed=*/7);
  const auto map = TestBuilder().Build(photons, {});
  const std::vector<float> positions = {0.5f, 0.5f, 0.5f};
  const auto answer = (*map)->Gather(
      {positions, {}, {}}, {.k = 0, .radius = 5, .outputs = kOutputCount | kOutputStatistics});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->counts[0], 20011u);
  EXPECT_EQ(answer->distance_tests[0], 0u);
}

TEST(GathererTest, DensityOfAnEndlessOrEmptyDiscIsZero) {
  const Photons photons = MakeCloud(CloudNamed("all_equal"), 10, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const std::vector<float> positions = {photons.positions[0], photons.positions[1],
                                        photons.positions[2]};
  for (const Gatherer* map : {pair.device.get(), pair.brute_force.get()}) {
    const auto endless =
        map->Gather({positions, {}, {}}, {.k = 20, .outputs = kOutputDensity | kOutputRadius});
    EXPECT_EQ(endless->densities, (std::vector<float>{0, 0, 0}));
    EXPECT_EQ(endless->radii, (std::vector<float>{kUnlimited}));
    const auto point =
        map->Gather({positions, {}, {}}, {.k = 5, .outputs = kOutputDensity | kOutputRadius});
    EXPECT_EQ(point->densities, (std::vector<float>{0, 0, 0}));
    EXPECT_EQ(point->radii, (std::vector<float>{0}));
  }
}

TEST(GathererTest, ACancelledGatherStops) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 1000, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const auto positions = MakeQueries(photons, 100, /*seed=*/8);
  for (const GatherOptions& options : {GatherOptions{.k = 5}, GatherOptions{.k = 0, .radius = 1},
                                       GatherOptions{.k = 0, .radius = 1, .outputs = 4}}) {
    const auto answer = pair.device->Gather({positions, {}, {}}, options, [] { return true; });
    EXPECT_EQ(answer.status().code(), absl::StatusCode::kCancelled);
  }
}

}  // namespace
}  // namespace treelight
