// Densities that add up whole subtrees: the moments, the lines that stand for kernels, and answers
// against brute force on every cloud and kind of search.

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/builder.h"
#include "core/cpu/tree_gatherer.h"
#include "core/cpu/whole_sum.h"
#include "core/gatherer.h"
#include "core/model/power_moments.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr DensityKernel kKernels[] = {DensityKernel::kConstant, DensityKernel::kCone,
                                      DensityKernel::kEpanechnikov};
constexpr std::uint32_t kSums = kOutputCount | kOutputRadius | kOutputDensity | kOutputErrorBound;

double Weight(DensityKernel kernel, double s) {
  if (kernel == DensityKernel::kConstant) return 1;
  return kernel == DensityKernel::kCone ? 3 * (1 - std::sqrt(s)) : 2 * (1 - s);
}

TEST(LineariseTest, IsAsFarFromTheKernelAsItSays) {
  for (const DensityKernel kernel : kKernels) {
    for (const auto& [near, far] : std::vector<std::pair<float, float>>{
             {0.0f, 0.0f}, {0.0f, 1.0f}, {0.25f, 1.0f}, {0.5f, 0.51f}, {1.0f, 1.0f}}) {
      const LinearWeight line = Linearise(kernel, near, far);
      double largest = 0;
      for (int i = 0; i <= 1000; ++i) {
        const double s = near + (double{far} - near) * i / 1000;
        largest = std::max(largest, std::fabs(line.constant + line.slope * s - Weight(kernel, s)));
      }
      EXPECT_NEAR(largest, line.error, 1e-3 * line.error + 1e-6) << near << " to " << far;
    }
  }
  // The cone over the whole disc: a = 0, b = 1, so 3 / 8.
  EXPECT_FLOAT_EQ(Linearise(DensityKernel::kCone, 0, 1).error, 0.375f);
}

TEST(PowerMomentsTest, AWorkedExample) {
  // Two photons on the x axis in the left leaf, 2 apart: the unit is 2, the offsets are -1/2, 1/2.
  Photons photons;
  photons.positions = {0, 0, 0, 2, 0, 0, 100, 0, 0, 101, 0, 0};
  photons.powers = {1, 2, 3, 5, -6, 7, 1, 1, 1, 1, 1, 1};
  const auto map = *MakeCpuBuilder()->Build(photons, {.max_leaf_size = 2});
  const auto moments = ComputeMoments(*map->ReadTree(), photons.powers);
  ASSERT_EQ(moments.size(), 2u);
  const float expected[3][5] = {{6, 2, 0, 0, 1.5f}, {-4, -4, 0, 0, -1}, {10, 2, 0, 0, 2.5f}};
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 5; ++i) EXPECT_EQ(moments[0].channels[c][i], expected[c][i]) << c << i;
  }
  EXPECT_EQ(moments[0].absolute, 10);
}

/// `answer` is within its bounds of `exact`, and its bounds are what the tolerance allows.
void ExpectBounded(const GatherResult& answer, const GatherResult& exact, const Photons& photons,
                   const GatherOptions& options) {
  ASSERT_TRUE(SameArray("counts", answer.counts, exact.counts));
  ASSERT_TRUE(SameArray("radii", answer.radii, exact.radii));
  ASSERT_EQ(answer.error_bounds.size(), exact.counts.size());
  const double peak = PeakWeight(options.kernel);
  const double power =
      photons.powers.empty() ? 0 : *std::max_element(photons.powers.begin(), photons.powers.end());
  for (std::size_t i = 0; i < exact.counts.size(); ++i) {
    const double r = exact.radii[i], n = exact.counts[i], bound = answer.error_bounds[i];
    if (r * r < 1e-30) continue;  // the squares underflow: no digits are left to compare
    const double largest = std::isfinite(r) ? n * peak * power / (M_PI * r * r) : 0;
    ASSERT_LE(bound, options.approximation.weight_tolerance * largest * (1 + 1e-5));
    if (options.kernel != DensityKernel::kCone) {
      ASSERT_EQ(bound, 0);
    }
    for (std::size_t c = 0; c < 3; ++c) {
      ASSERT_NEAR(answer.densities[3 * i + c], exact.densities[3 * i + c],
                  bound + (n + 30) * 0x1p-24 * largest + std::numeric_limits<float>::min())
          << "query " << i;
    }
  }
}

class EveryCloud : public testing::TestWithParam<std::string> {};

TEST_P(EveryCloud, DensitiesAreWithinTheirBounds) {
  for (const std::size_t size : {0, 1, 40, 2003}) {
    const Photons photons = MakeCloud(CloudNamed(GetParam()), size, /*seed=*/7);
    const auto brute_force = *MakeBruteForceBuilder()->Build(photons, {});
    const auto device = *TestBuilder().Build(photons, {.max_leaf_size = 8});
    std::vector<std::unique_ptr<Gatherer>> packed;
    for (const Instructions instructions : SupportedInstructions()) {
      packed.push_back(MakeTreeGatherer(photons, *device->ReadTree(), {}, instructions));
    }
    const auto positions = MakeQueries(photons, 97, /*seed=*/8);
    const GatherQueries queries{.positions = positions};
    const float median = MedianRadius(*brute_force, queries, 50);
    for (const float radius : {0.0f, median, 5 * median, 1e30f}) {
      for (const DensityKernel kernel : kKernels) {
        GatherOptions options{.k = 0, .radius = radius, .outputs = kSums, .kernel = kernel};
        options.outputs &= ~kOutputErrorBound;
        const auto exact = *brute_force->Gather(queries, options);
        for (const float tolerance : {0.01f, 1.0f}) {
          options.approximation = {.weight_tolerance = tolerance};
          SCOPED_TRACE(testing::Message()
                       << "size " << size << ", radius " << radius << ", tolerance " << tolerance);
          options.outputs = kSums;
          const auto check = [&](const Gatherer& map) {
            const auto answer = map.Gather(queries, options);
            ASSERT_TRUE(answer.ok()) << answer.status();
            ExpectBounded(*answer, exact, photons, options);
          };
          for (const auto& map : packed) check(*map);
          check(*device);
          options.outputs |= kOutputStatistics;
          check(*packed.front());
          const auto plain = *packed.front()->Gather(queries, options);
          const auto on_device = *device->Gather(queries, options);
          ASSERT_EQ(plain.nodes_visited, on_device.nodes_visited);
          ASSERT_EQ(plain.distance_tests, on_device.distance_tests);
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Clouds, EveryCloud, testing::ValuesIn(CloudNames()),
                         [](const auto& test) { return test.param; });

TEST(ApproximateDensityTest, WholeSubtreesAreNotLookedAt) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 20011, /*seed=*/7);
  const auto map = *TestBuilder().Build(photons, {});
  const std::vector<float> positions = {0.5f, 0.5f, 0.5f};
  const auto tests = [&](float tolerance) {
    GatherOptions options{.k = 0,
                          .radius = 5,
                          .outputs = kOutputDensity | kOutputStatistics,
                          .kernel = DensityKernel::kCone};
    options.approximation.weight_tolerance = tolerance;
    return map->Gather({.positions = positions}, options)->distance_tests[0];
  };
  EXPECT_EQ(tests(0), 20011u);
  EXPECT_EQ(tests(1), 0u);
  EXPECT_GT(tests(0.0001f), 0u);
}

TEST(ApproximateDensityTest, ListsComeBesideIt) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 3001, /*seed=*/7);
  const auto positions = MakeQueries(photons, 40, /*seed=*/8);
  const GatherQueries queries{.positions = positions};
  GatherOptions options{.k = 0, .radius = 0.2f, .outputs = kOutputNeighbors | kOutputCount};
  const auto exact = *MakeBruteForceBuilder()->Build(photons, {});
  const auto expected = *exact->Gather(queries, options);
  options.outputs |= kOutputDensity;
  options.approximation.weight_tolerance = 0.1f;
  for (const std::uint32_t statistics : {0u, kOutputStatistics}) {
    options.outputs |= statistics;
    for (const auto& map :
         {*TestBuilder().Build(photons, {}), *MakeCpuBuilder()->Build(photons, {})}) {
      EXPECT_TRUE(SameExactAnswers(*map->Gather(queries, options), expected));
    }
  }
}

TEST(ApproximateDensityTest, WhatIsNotPossibleIsRefused) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 100, /*seed=*/7);
  const auto map = *MakeCpuBuilder()->Build(photons, {});
  const std::vector<float> point = {1, 2, 3};
  const auto refused = [&](const GatherQueries& queries, const GatherOptions& options) {
    return std::string(map->Gather(queries, options).status().message());
  };
  const auto options = [](std::uint32_t k, std::uint32_t outputs, float tolerance) {
    return GatherOptions{
        .k = k, .radius = 1, .outputs = outputs, .approximation = {.weight_tolerance = tolerance}};
  };
  EXPECT_EQ(refused({.positions = point}, options(0, kOutputDensity, 1.5f)),
            "approximation.weight_tolerance is 1.5, it must be in [0, 1]");
  EXPECT_EQ(refused({.positions = point}, options(5, kOutputDensity, 0.5f)),
            "approximation.weight_tolerance is 0.5, but k is not 0: it is for all photons within a "
            "radius");
  EXPECT_EQ(refused({.positions = point}, options(0, kOutputCount, 0.5f)),
            "approximation.weight_tolerance is 0.5, but DENSITY is not among the outputs");
  EXPECT_EQ(refused({.positions = point, .normals = point}, options(0, kOutputDensity, 0.5f)),
            "approximation.weight_tolerance is 0.5, but there are normals, which judge photons one "
            "by one");
}

}  // namespace
}  // namespace treelight
