#include <chrono>

#include "core/gpu/paced_launches.h"
#include "gtest/gtest.h"

namespace treelight {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kLargest = 1 << 20;

GatherParams Asking(cl_uint k) {
  GatherParams params{};
  params.k = k;
  return params;
}

TEST(LaunchPaceTest, PartsGrowToTwentyMillisecondsAtMostFourfold) {
  LaunchPace pace;
  EXPECT_EQ(pace.Begin(Asking(8), 1000, kLargest), 1000u);
  EXPECT_EQ(pace.Next(1000, milliseconds(1), kLargest), 4000u);
  EXPECT_EQ(pace.Next(4000, milliseconds(10), kLargest), 8000u);
  EXPECT_EQ(pace.Next(8000, milliseconds(40), kLargest), 4000u);
  EXPECT_EQ(pace.Next(4000, milliseconds(1000), kLargest), 1000u);
  EXPECT_EQ(pace.Next(1000, milliseconds(1), 3000), 3000u);
}

TEST(LaunchPaceTest, TheNextBatchThatAsksTheSameGoesOn) {
  LaunchPace pace;
  pace.Begin(Asking(8), 1000, kLargest);
  pace.Next(1000, milliseconds(5), kLargest);
  GatherParams again = Asking(8);
  again.first = 17;  // of another launch
  again.count = 99;
  EXPECT_EQ(pace.Begin(again, 1000, kLargest), 4000u);
  EXPECT_EQ(pace.Begin(again, 1000, 2500), 2500u) << "as many as there is room for";
  EXPECT_EQ(pace.Begin(Asking(50), 1000, kLargest), 1000u);
  EXPECT_EQ(pace.Begin(Asking(8), 1000, kLargest), 1000u) << "only the last one is remembered";
}

TEST(LaunchPaceTest, ASmallRestSaysNothingAgainstLargeParts) {
  LaunchPace pace;
  pace.Begin(Asking(8), 1000, kLargest);
  pace.Next(1000, milliseconds(5), kLargest);
  pace.Next(10, milliseconds(1), kLargest);
  EXPECT_EQ(pace.Begin(Asking(8), 1000, kLargest), 4000u);
}

TEST(LaunchPaceTest, RadiiOfEachQueryMayMeanOtherWork) {
  LaunchPace pace;
  GatherParams params = Asking(8);
  params.has_radii = 1;
  pace.Begin(params, 1000, kLargest);
  pace.Next(1000, milliseconds(1), kLargest);
  EXPECT_EQ(pace.Begin(params, 1000, kLargest), 1000u);
}

}  // namespace
}  // namespace treelight
