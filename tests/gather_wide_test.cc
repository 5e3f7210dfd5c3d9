// Gathers by sub-groups, against brute force, where the test device has them.

#include <limits>

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
      for (const std::uint32_t k : {9u, 50u, 64u, 65u, 128u}) {
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

}  // namespace
}  // namespace treelight
