// Which kernel answers what, for devices with and without sub-groups of 32.

#include "core/gpu/search_choice.h"

#include <string>

#include "gtest/gtest.h"

namespace treelight {
namespace {

using enum DeviceSearch;

struct Case {
  GatherOptions options;
  DeviceSearch with_wide_tree, without;
};

std::string KernelOf(DeviceSearch search) {
  switch (search) {
    case kGatherNearest:
      return "gather_nearest";
    case kGatherWide:
      return "gather_wide";
    case kGatherLong:
      return "gather_long";
    case kGatherList:
      return "gather_list";
    case kGatherSums:
      return "gather_sums";
    case kCountWide:
      return "count_wide";
    case kDensityWide:
      return "density_wide";
    case kGatherRange:
      return "gather_range";
  }
  return "none";
}

TEST(ChooseSearchTest, TheKernelForWhatIsAsked) {
  constexpr std::uint32_t kCounts = kOutputCount, kSums = kOutputCount | kOutputDensity,
                          kLists = kOutputNeighbors | kOutputDensity;
  constexpr float kR = 1;
  const Case cases[] = {
      {{.k = 1, .outputs = kLists}, kGatherNearest, kGatherNearest},
      {{.k = 16, .outputs = kLists}, kGatherNearest, kGatherNearest},
      {{.k = 17, .outputs = kLists}, kGatherWide, kGatherNearest},
      {{.k = 50, .radius = kR, .outputs = kSums}, kGatherWide, kGatherNearest},
      {{.k = 64, .outputs = kCounts}, kGatherWide, kGatherNearest},
      {{.k = 65, .outputs = kCounts}, kGatherLong, kGatherNearest},
      {{.k = kMaxNeighbors, .outputs = kLists}, kGatherLong, kGatherNearest},
      {{.k = 500, .outputs = kCounts | kOutputStatistics}, kGatherNearest, kGatherNearest},
      {{.k = 50, .outputs = kCounts | kOutputStatistics}, kGatherNearest, kGatherNearest},
      {{.k = 50, .outputs = kCounts, .approximation = {.epsilon = 0.1f}},
       kGatherNearest,
       kGatherNearest},
      {{.k = 50, .outputs = kCounts, .approximation = {.max_leaves = 3}},
       kGatherNearest,
       kGatherNearest},
      // A Gatherer knows of no merged photons, and is exact then.
      {{.k = 50, .outputs = kSums, .approximation = {.max_relative_error = 0.1f}},
       kGatherWide,
       kGatherNearest},
      {{.radius = kR, .outputs = kCounts}, kCountWide, kGatherRange},
      {{.radius = kR, .outputs = kCounts | kOutputRadius}, kCountWide, kGatherRange},
      {{.radius = kR, .outputs = kCounts | kOutputStatistics}, kGatherRange, kGatherRange},
      {{.radius = kR, .outputs = kSums}, kDensityWide, kGatherRange},
      {{.radius = kR, .outputs = kSums | kOutputStatistics}, kGatherRange, kGatherRange},
      {{.radius = kR, .outputs = kSums, .approximation = {.weight_tolerance = 0.1f}},
       kGatherSums,
       kGatherSums},
      {{.radius = kR, .outputs = kLists}, kGatherList, kGatherList},
  };
  for (const Case& test : cases) {
    SCOPED_TRACE(testing::Message()
                 << "k " << test.options.k << ", outputs " << test.options.outputs);
    for (const bool has_wide_tree : {false, true}) {
      const SearchChoice choice = ChooseSearch(test.options, has_wide_tree, /*has_powers=*/true);
      EXPECT_EQ(choice.search, has_wide_tree ? test.with_wide_tree : test.without);
      EXPECT_EQ(choice.reason.substr(0, choice.reason.find(':')), KernelOf(choice.search));
    }
  }
}

TEST(ChooseSearchTest, DensitiesWithoutPowersAreCounts) {
  const GatherOptions sums{.radius = 1,
                           .outputs = kOutputCount | kOutputDensity,
                           .approximation = {.weight_tolerance = 0.1f}};
  EXPECT_EQ(ChooseSearch(sums, true, false).search, kCountWide);
  EXPECT_EQ(ChooseSearch(sums, false, false).search, kGatherRange);
}

}  // namespace
}  // namespace treelight
