// Gathers by sub-groups, against brute force, where the test device has them.

#include <cmath>
#include <limits>
#include <vector>

#include "core/builder.h"
#include "core/gatherer.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr std::uint32_t kExact = kOutputCount | kOutputRadius | kOutputNeighbors;
constexpr float kUnlimited = std::numeric_limits<float>::infinity();

TEST(GatherWideTest, AnswersAreBitEqualToBruteForce) {
  if (!TestGpu().device->has_sub_groups()) GTEST_SKIP() << "the test device has no sub-groups";
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 33, 1024, 20011}) {
      const Photons photons = MakeCloud(shape, size, /*seed=*/7);
      const BuildOptions options{.max_leaf_size = size % 2 == 0 ? 64u : 7u};
      const auto map = *TestBuilder().Build(photons, options);
      const auto brute_force = *MakeBruteForceBuilder()->Build(photons, options);
      const auto positions = MakeQueries(photons, 97, /*seed=*/8);
      const GatherQueries queries{positions, {}, {}};
      const float radius = MedianRadius(*brute_force, queries, 50);
      for (const std::uint32_t k :
           {17u, 50u, 64u, 65u, 128u, 129u, 200u, 500u, 1024u, kMaxNeighbors}) {
        for (const float r : {kUnlimited, radius, 0.0f}) {
          SCOPED_TRACE(shape.name + " " + std::to_string(size) + " k " + std::to_string(k));
          const GatherOptions gather{.k = k, .radius = r, .outputs = kExact};
          const auto actual = map->Gather(queries, gather);
          const auto expected = brute_force->Gather(queries, gather);
          ASSERT_TRUE(actual.ok()) << actual.status();
          ASSERT_TRUE(SameExactAnswers(*actual, *expected));
        }
      }
    }
  }
}

/// Queries [first, first + count) of a batch of positions.
GatherResult GatherPart(const Gatherer& map, const std::vector<float>& positions, std::size_t first,
                        std::size_t count, const GatherOptions& options) {
  const std::vector<float> part(positions.begin() + 3 * first,
                                positions.begin() + 3 * (first + count));
  return *map.Gather({part, {}, {}}, options);
}

/// Batches of many queries are searched by other variants of the kernels than those of few.
TEST(GatherWideTest, ManyQueriesHaveTheAnswersOfFew) {
  if (!TestGpu().device->has_sub_groups()) GTEST_SKIP() << "the test device has no sub-groups";
  constexpr std::size_t kQueries = 20'000, kPart = 1000;
  for (const CloudShape& shape : AllClouds()) {
    const Photons photons = MakeCloud(shape, 20'011, /*seed=*/9);
    const auto map = *TestBuilder().Build(photons, {});
    const auto positions = MakeQueries(photons, kQueries, /*seed=*/10);
    const float radius = MedianRadius(*map, {positions, {}, {}}, 50);
    for (const std::uint32_t k : {0u, 17u, 50u, 64u, 65u, 300u}) {
      SCOPED_TRACE(shape.name + " k " + std::to_string(k));
      GatherOptions options{.k = k, .radius = radius, .outputs = kOutputCount | kOutputDensity};
      if (k > 0) options.outputs |= kExact;
      GatherOptions counts = options;
      counts.outputs = kOutputCount;
      const GatherResult all = *map->Gather({positions, {}, {}}, options);
      EXPECT_EQ(map->Gather({positions, {}, {}}, counts)->counts, all.counts);
      for (std::size_t first = 0; first < kQueries; first += kPart) {
        const GatherResult part = GatherPart(*map, positions, first, kPart, options);
        for (std::size_t i = 0; i < kPart; ++i) {
          ASSERT_EQ(all.counts[first + i], part.counts[i]) << first + i;
          for (std::size_t c = 0; c < 3; ++c) {
            const float many = all.densities[3 * (first + i) + c], few = part.densities[3 * i + c];
            if (many == few) continue;  // infinite, it may be
            ASSERT_NEAR(many, few, 2e-6 * std::abs(few)) << first + i;
          }
          for (std::size_t n = 0; n < k; ++n) {
            ASSERT_EQ(all.neighbor_ids[(first + i) * k + n], part.neighbor_ids[i * k + n])
                << first + i;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace treelight
