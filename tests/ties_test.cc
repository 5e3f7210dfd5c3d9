#include "core/gpu/ties.h"

#include "core/device/guard.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

TieReport CheckTies(const CloudShape& shape, std::size_t size, int code_bits,
                    std::uint32_t max_leaf_size) {
  SortedCloud cloud = SortCloud(shape, size, code_bits);
  const auto ids = Upload(cloud.ids);
  const auto levels = Upload(cloud.levels);
  const TieReport report =
      BreakTies(TestGpu(), Upload(cloud.positions), size, static_cast<unsigned>(code_bits),
                max_leaf_size, ids, levels, {});
  reference::BreakTies(cloud.positions, code_bits, max_leaf_size, cloud.ids, cloud.levels);
  EXPECT_EQ(ids.Read(TestGpu().queue()), cloud.ids)
      << shape.name << " " << size << " " << code_bits;
  EXPECT_EQ(levels.Read(TestGpu().queue()), cloud.levels)
      << shape.name << " " << size << " " << code_bits;
  return report;
}

TEST(TiesTest, KernelsAgreeWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 2, 255, 256, 257, 20011}) {
      for (const int code_bits : {30, 63}) CheckTies(shape, size, code_bits, /*max_leaf_size=*/16);
    }
    CheckTies(shape, 3001, 30, /*max_leaf_size=*/1);
    CheckTies(shape, 3001, 30, /*max_leaf_size=*/64);
    CheckTies(shape, 5003, 30, /*max_leaf_size=*/1000);
  }
}

TEST(TiesTest, AnOrdinaryCloudNeedsNoRound) {
  const TieReport report = CheckTies(CloudNamed("uniform"), 20011, 30, 16);
  EXPECT_EQ(report.tied_photons, 0u);
  EXPECT_EQ(report.code_rounds + report.median_rounds, 0u);
}

TEST(TiesTest, OneRoundTellsFarClustersApart) {
  const TieReport report = CheckTies(CloudNamed("two_far_clusters"), 20011, 30, 16);
  EXPECT_EQ(report.tied_photons, 20011u);
  EXPECT_EQ(report.code_rounds, 1u);
  EXPECT_EQ(report.median_rounds, 0u);
}

TEST(TiesTest, MediansTakeOverWhereCodesEnd) {
  const TieReport report = CheckTies(CloudNamed("extreme_scales"), 20011, 30, 16);
  EXPECT_EQ(report.code_rounds, 2u);
  EXPECT_GT(report.median_rounds, 3u);
}

TEST(TiesTest, EqualPhotonsEndTheRounds) {
  const TieReport report = CheckTies(CloudNamed("all_equal"), 20011, 30, 16);
  EXPECT_EQ(report.code_rounds, 1u);
  EXPECT_EQ(report.median_rounds, 0u);
}

TEST(TiesTest, ACancelledBuildStops) {
  const SortedCloud cloud = SortCloud(CloudNamed("all_equal"), 1000, 30);
  const auto run = [&]() -> absl::Status {
    BreakTies(TestGpu(), Upload(cloud.positions), 1000, 30, 16, Upload(cloud.ids),
              Upload(cloud.levels), [] { return true; });
    return absl::OkStatus();
  };
  EXPECT_EQ(Guard(run).code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace treelight
