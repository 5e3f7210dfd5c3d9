#ifndef TREELIGHT_TESTS_ANSWERS_H_
#define TREELIGHT_TESTS_ANSWERS_H_

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/gatherer.h"
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

/// Half of the k-th distances of the queries are above this; 1 where there are fewer photons.
inline float MedianRadius(const Gatherer& map, const GatherQueries& queries, std::uint32_t k) {
  auto radii = map.Gather(queries, {.k = k, .outputs = kOutputRadius})->radii;
  const auto median = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), median, radii.end());
  return std::isinf(*median) ? 1.0f : *median;
}

}  // namespace treelight

#endif  // TREELIGHT_TESTS_ANSWERS_H_
