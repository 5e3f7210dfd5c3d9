// The kernel of ties_short.cl on the host (work_group.h), against the reference.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/gpu/gpu.h"
#include "gtest/gtest.h"
#include "tests/emulated/ties_short.h"
#include "tests/emulated/work_group.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight::emulated {
namespace {

// As CMakeLists.txt has it.
static_assert(kSubGroupsPerGroup == 2 && kTieShortRun == 512 && kTieBoundaries == 8);

/// How many runs of equal codes longer than a leaf there were.
struct Runs {
  std::size_t rebuilt = 0, left = 0;
};

/// Whether places [first, last) are the same photons in both, and divided by the same levels.
bool SameRun(const SortedCloud& a, const SortedCloud& b, std::size_t first, std::size_t last) {
  for (std::size_t i = first; i < last; ++i) {
    if (a.ids[i] != b.ids[i]) return false;
    if (i + 1 < last && a.levels[i] != b.levels[i]) return false;
  }
  return true;
}

/// What tie_levels_of_places does in the end.
void SplitByPlaces(std::vector<std::uint8_t>& levels) {
  for (std::uint32_t i = 0; i < levels.size(); ++i) {
    if (levels[i] >= kLevelSame)
      levels[i] = static_cast<std::uint8_t>(kLevelIndex + std::countl_zero(i ^ (i + 1)));
  }
}

/// Expects each run to be as the reference has it, or as it was.
Runs CheckRuns(const CloudShape& shape, std::size_t size, int code_bits,
               std::uint32_t max_leaf_size) {
  SortedCloud before = SortCloud(shape, size, code_bits);
  SortedCloud actual = before, expected = before;
  std::uint32_t rest = 0;
  const TiesArguments arguments{.positions = before.positions.data(),
                                .n = static_cast<std::uint32_t>(size),
                                .max_leaf_size = max_leaf_size,
                                .base = static_cast<std::uint32_t>(code_bits),
                                .ids = actual.ids.data(),
                                .levels = actual.levels.data(),
                                .rest = &rest};
  constexpr std::size_t kGroupPhotons = kTieBoundaries * kSubGroupSize * kSubGroupsPerGroup;
  RunWorkGroups((size + kGroupPhotons - 1) / kGroupPhotons, kSubGroupsPerGroup,
                [&] { run_tie_short_runs(&arguments); });
  reference::BreakTies(before.positions, code_bits, max_leaf_size, expected.ids, expected.levels);
  const std::vector<std::uint8_t> codes = before.levels;
  SplitByPlaces(before.levels);
  SplitByPlaces(actual.levels);

  Runs runs;
  for (std::size_t first = 0, last = 1; first < size; first = last++) {
    while (last < size && codes[last - 1] == kLevelTied) ++last;
    if (last < size) {
      EXPECT_EQ(actual.levels[last - 1], expected.levels[last - 1]);
    }
    const bool is_right = SameRun(actual, expected, first, last);
    if (last - first > kTieShortRun || !is_right) {
      EXPECT_TRUE(SameRun(actual, before, first, last)) << "run [" << first << ", " << last << ")";
      ++runs.left;
    } else if (last - first > max_leaf_size) {
      ++runs.rebuilt;
    }
  }
  EXPECT_EQ(rest, runs.left > 0 ? 1u : 0u);
  return runs;
}

TEST(EmulatedTiesTest, ShortRunsAreThoseOfTheReferenceOrLeft) {
  std::size_t rebuilt = 0, left = 0;
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 33, 512, 513, 5003}) {
      for (const int code_bits : {30, 63}) {
        for (const std::uint32_t max_leaf_size : {1u, 16u, 1000u}) {
          SCOPED_TRACE(shape.name + " " + std::to_string(size) + " " + std::to_string(code_bits) +
                       " " + std::to_string(max_leaf_size));
          const Runs runs = CheckRuns(shape, size, code_bits, max_leaf_size);
          rebuilt += runs.rebuilt;
          left += runs.left;
        }
      }
    }
  }
  EXPECT_GT(rebuilt, 20 * left);  // few need more than one round
}

}  // namespace
}  // namespace treelight::emulated
