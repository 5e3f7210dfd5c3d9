#ifndef TREELIGHT_TESTS_ANSWERS_H_
#define TREELIGHT_TESTS_ANSWERS_H_

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/gatherer.h"
#include "core/model/photons.h"
#include "gtest/gtest.h"

namespace treelight {

/// Whether two arrays of answers are equal; tells the first place where they are not.
template <typename T>
testing::AssertionResult SameArray(const char* name, const std::vector<T>& actual,
                                   const std::vector<T>& expected) {
  if (actual.size() != expected.size()) {
    return testing::AssertionFailure()
           << name << ": " << actual.size() << " numbers, expected " << expected.size();
  }
  const auto [a, e] = std::mismatch(actual.begin(), actual.end(), expected.begin());
  if (a == actual.end()) return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << name << "[" << a - actual.begin() << "] is " << *a << ", expected " << *e;
}

/// Whether all that is exact in two answers is the same: counts, radii and neighbours.
inline testing::AssertionResult SameExactAnswers(const GatherResult& actual,
                                                 const GatherResult& expected) {
  for (const testing::AssertionResult& result :
       {SameArray("counts", actual.counts, expected.counts),
        SameArray("radii", actual.radii, expected.radii),
        SameArray("neighbor_ids", actual.neighbor_ids, expected.neighbor_ids),
        SameArray("neighbor_squared_distances", actual.neighbor_squared_distances,
                  expected.neighbor_squared_distances),
        SameArray("neighbor_offsets", actual.neighbor_offsets, expected.neighbor_offsets)}) {
    if (!result) return result;
  }
  return testing::AssertionSuccess();
}

/// Expects densities of sums whose roundings do not grow with their number, of terms that are right
/// to a few roundings: within 16 * 2^-24 of the sum of all terms at their largest weight.
/// `expected` has counts and radii.
inline void ExpectCloseDensities(const GatherResult& actual, const GatherResult& expected,
                                 const Photons& photons, DensityKernel kernel) {
  const double peak = kernel == DensityKernel::kConstant ? 1
                      : kernel == DensityKernel::kCone   ? 3
                                                         : 2;
  const double largest_power = *std::max_element(photons.powers.begin(), photons.powers.end());
  ASSERT_EQ(actual.densities.size(), expected.densities.size());
  for (std::size_t i = 0; i < expected.densities.size(); ++i) {
    const double n = expected.counts[i / 3], r = expected.radii[i / 3];
    if (r * r < 1e-30) continue;  // the squares underflow: no digits are left to compare
    const double largest_sum =
        r > 0 && std::isfinite(r) ? n * peak * largest_power / (M_PI * r * r) : 0;
    ASSERT_NEAR(actual.densities[i], expected.densities[i],
                16 * 0x1p-24 * largest_sum + std::numeric_limits<float>::min())
        << i;
  }
}

/// Half of the k-th distances of the queries are above this; 1 where there are fewer photons.
inline float MedianRadius(const Gatherer& map, const GatherQueries& queries, std::uint32_t k) {
  auto radii = map.Gather(queries, {.k = k, .outputs = kOutputRadius})->radii;
  const auto median = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), median, radii.end());
  return std::isinf(*median) ? 1.0f : *median;
}

}  // namespace treelight

#endif  // TREELIGHT_TESTS_ANSWERS_H_
