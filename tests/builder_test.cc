#include "core/builder.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "gtest/gtest.h"
#include "tests/refused.h"
#include "tests/test_device.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

Tree BuildTree(const Photons& photons, const BuildOptions& options) {
  const auto map = TestBuilder().Build(photons, options);
  EXPECT_TRUE(map.ok()) << map.status();
  auto tree = (*map)->ReadTree();
  EXPECT_TRUE(tree.ok()) << tree.status();
  return *std::move(tree);
}

class EveryCloud : public testing::TestWithParam<std::string> {};

TEST_P(EveryCloud, TreeKeepsTheInvariants) {
  for (const std::size_t size : {0, 1, 2, 3, 15, 16, 17, 255, 256, 257, 20011}) {
    const Photons photons = MakeCloud(CloudNamed(GetParam()), size, /*seed=*/7);
    for (const MortonBits bits : {MortonBits::k30, MortonBits::k63}) {
      for (const std::uint32_t max_leaf_size : {1u, 16u, 64u}) {
        const Tree tree = BuildTree(photons, {.morton_bits = bits, .max_leaf_size = max_leaf_size});
        const absl::Status status = ValidateTree(tree, photons);
        ASSERT_TRUE(status.ok()) << status << " size " << size << " leaf " << max_leaf_size;
      }
    }
  }
}

TEST_P(EveryCloud, TheSameTreeAgainBitByBit) {
  const Photons photons = MakeCloud(CloudNamed(GetParam()), 20011, /*seed=*/7);
  const Tree first = BuildTree(photons, {});
  for (int run = 0; run < 3; ++run) {
    const Tree again = BuildTree(photons, {});
    ASSERT_EQ(std::memcmp(&first.root, &again.root, sizeof first.root), 0);
    ASSERT_EQ(first.nodes.size(), again.nodes.size());
    if (!first.nodes.empty()) {
      ASSERT_EQ(
          std::memcmp(first.nodes.data(), again.nodes.data(), first.nodes.size() * sizeof(Node)),
          0);
    }
    ASSERT_EQ(std::memcmp(first.photons.data(), again.photons.data(),
                          first.photons.size() * sizeof(LeafPhoton)),
              0);
    ASSERT_EQ(first.min_ids, again.min_ids);
  }
}

INSTANTIATE_TEST_SUITE_P(Clouds, EveryCloud, testing::ValuesIn(CloudNames()),
                         [](const auto& test) { return test.param; });

TEST(BuilderTest, AFreshCloudKeepsTheInvariants) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  for (const CloudShape& shape : AllClouds()) {
    const Photons photons = MakeCloud(shape, 1000 + seed % 5000, seed);
    const absl::Status status = ValidateTree(BuildTree(photons, {}), photons);
    ASSERT_TRUE(status.ok()) << shape.name << " " << status;
  }
}

TEST(BuilderTest, ReportsStagesAndStatistics) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 20011, /*seed=*/7);
  const auto map = TestBuilder().Build(photons, {});
  ASSERT_TRUE(map.ok()) << map.status();
  const BuildReport& report = (*map)->report();
  std::vector<std::string> stages;
  for (const StageTime& stage : report.stages) {
    stages.push_back(stage.stage);
    EXPECT_GE(stage.microseconds, 0) << stage.stage;
  }
  std::vector<std::string> expected = {"upload", "bounds", "morton",  "sort",      "levels",
                                       "ties",   "leaves", "permute", "hierarchy", "statistics"};
  if (TestGpu().device->has_sub_groups()) expected.push_back("wide");
  EXPECT_EQ(stages, expected);
  EXPECT_GT(report.device_bytes, 20011u * (16 + 12 + 4));
  const TreeStatistics plain = ComputeStatistics(*(*map)->ReadTree());
  EXPECT_EQ(report.tree.leaf_count, plain.leaf_count);
  EXPECT_EQ(report.tree.depth, plain.depth);
  EXPECT_NEAR(report.tree.sah_cost, plain.sah_cost, 1e-5 * plain.sah_cost);
}

struct BadBuild {
  const char* name;
  Photons photons;
  BuildOptions options;
  const char* message;
};

class BadBuildTest : public testing::TestWithParam<BadBuild> {};

TEST_P(BadBuildTest, IsRefusedByName) {
  const auto brute_force = MakeBruteForceBuilder();
  for (Builder* builder : {&TestBuilder(), brute_force.get()}) {
    const auto map = builder->Build(GetParam().photons, GetParam().options);
    ExpectInvalidArgument(map.status(), GetParam().message);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cases, BadBuildTest,
    testing::Values(
        BadBuild{"Nan",
                 {{1, 2, 3, 4, kNan, 6}, {}, {}},
                 {},
                 "positions[4] of photon 1 is nan, it must be finite and within 1e+18"},
        BadBuild{"Infinite",
                 {{1, 2, INFINITY}, {}, {}},
                 {},
                 "positions[2] of photon 0 is inf, it must be finite and within 1e+18"},
        BadBuild{"BeyondTheLimit",
                 {{1, 2, -1.1e18f}, {}, {}},
                 {},
                 "positions[2] of photon 0 is -1.1e+18, it must be finite and within 1e+18"},
        BadBuild{
            "OddLength", {{1, 2, 3, 4}, {}, {}}, {}, "positions: 4 numbers are no multiple of 3"},
        BadBuild{"PowersMissing",
                 {{1, 2, 3, 4, 5, 6}, {1, 1, 1}, {}},
                 {},
                 "powers: 3 numbers, expected 6 or none"},
        BadBuild{"PowerNan",
                 {{1, 2, 3}, {1, kNan, 1}, {}},
                 {},
                 "powers[1] of photon 0 is nan, it must be finite"},
        BadBuild{"DirectionsMissing",
                 {{1, 2, 3}, {}, {1}},
                 {},
                 "directions: 1 numbers, expected 2 or none"},
        BadBuild{"NoLeafSize",
                 {{1, 2, 3}, {}, {}},
                 {.max_leaf_size = 0},
                 "max_leaf_size is 0, it must be in [1, 64]"},
        BadBuild{"LargeLeafSize",
                 {{1, 2, 3}, {}, {}},
                 {.max_leaf_size = 65},
                 "max_leaf_size is 65, it must be in [1, 64]"},
        BadBuild{"MortonBits",
                 {{1, 2, 3}, {}, {}},
                 {.morton_bits = MortonBits{31}},
                 "morton_bits is 31, it must be 30 or 63"}),
    [](const auto& test) { return test.param.name; });

TEST(BuilderTest, CoordinatesUpToTheLimitAreTaken) {
  Photons photons;
  photons.positions = {-1e18f, -1e18f, -1e18f, 1e18f, 1e18f, 1e18f, 0, 0, 0};
  const Tree tree = BuildTree(photons, {.max_leaf_size = 1});
  EXPECT_TRUE(ValidateTree(tree, photons).ok());
}

TEST(BuilderTest, ACancelledBuildStops) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 1000, /*seed=*/7);
  EXPECT_EQ(TestBuilder().Build(photons, {}, [] { return true; }).status().code(),
            absl::StatusCode::kCancelled);
}

TEST(BuilderTest, AMapLargerThanOneBufferIsRefusedWithTheLimit) {
  const std::uint64_t limit = TestGpu().device->info().max_buffer_bytes / sizeof(LeafPhoton);
  if (limit > 100'000'000)
    GTEST_SKIP() << "the device takes " << limit << " photons, too many to try";
  Photons photons;
  photons.positions.assign(3 * (limit + 1), 0.5f);
  const auto map = TestBuilder().Build(photons, {});
  EXPECT_EQ(map.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(map.status().message().find("that is " + std::to_string(limit) + " photons"),
            std::string::npos)
      << map.status();
}

}  // namespace
}  // namespace treelight
