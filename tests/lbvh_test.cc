#include "core/cpu/lbvh.h"

#include <cmath>
#include <random>

#include "gtest/gtest.h"
#include "tests/test_device.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

// The device's stages and this code share types.h and nothing else.
TEST(LbvhTest, TheTreeIsTheDevicesBitByBit) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 2, 16, 17, 257, 20011}) {
      const Photons photons = MakeCloud(shape, size, /*seed=*/7);
      for (const MortonBits bits : {MortonBits::k30, MortonBits::k63}) {
        for (const std::uint32_t max_leaf_size : {1u, 5u, 16u}) {
          const auto map =
              TestBuilder().Build(photons, {.morton_bits = bits, .max_leaf_size = max_leaf_size});
          ASSERT_TRUE(map.ok()) << map.status();
          const Tree tree =
              Arrange(BuildLbvh(photons.positions, bits, MortonLayout::kCubic, max_leaf_size),
                      TreeKind::kKdTree, max_leaf_size);
          ASSERT_TRUE(SameTree(tree, *(*map)->ReadTree()))
              << shape.name << " " << size << " leaf " << max_leaf_size;
        }
      }
    }
  }
}

// Scales too far apart for codes, so that medians split; and coordinates that are often equal.
TEST(LbvhTest, MediansOfEqualCoordinatesAreTheDevices) {
  Photons photons;
  std::mt19937 random(7);
  for (int i = 0; i < 20011; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      photons.positions.push_back(std::ldexp(static_cast<float>(1 + random() % 3), 40 - i % 160));
    }
  }
  for (const std::uint32_t max_leaf_size : {1u, 5u}) {
    const auto map = TestBuilder().Build(photons, {.max_leaf_size = max_leaf_size});
    const Tree tree =
        Arrange(BuildLbvh(photons.positions, MortonBits::k30, MortonLayout::kCubic, max_leaf_size),
                TreeKind::kKdTree, max_leaf_size);
    EXPECT_TRUE(ValidateTree(tree, photons).ok());
    EXPECT_TRUE(SameTree(tree, *(*map)->ReadTree()));
  }
}

TEST(LbvhTest, KarrasLayoutIsAValidBvh) {
  for (const CloudShape& shape : AllClouds()) {
    const Photons photons = MakeCloud(shape, 5003, /*seed=*/7);
    for (const MortonBits bits : {MortonBits::k30, MortonBits::k63}) {
      const Tree tree =
          Arrange(BuildLbvh(photons.positions, bits, MortonLayout::kPerAxis, 8), TreeKind::kBvh, 8);
      const absl::Status status = ValidateTree(tree, photons);
      ASSERT_TRUE(status.ok()) << shape.name << " " << status;
    }
  }
}

// Karras 2012, figure 3, as codes along x: keys 00001 00010 00100 00101 10011 11000 11001 11110,
// and 00000 and 11111 beside them, which stretch the grid to all cells.
TEST(LbvhTest, WorkedExampleOfKarras) {
  Photons photons;
  for (const float key : {0, 1, 2, 4, 5, 19, 24, 25, 30, 31}) {
    photons.positions.insert(photons.positions.end(), {key, 0, 0});
  }
  const Tree tree = Arrange(
      BuildLbvh(photons.positions, MortonBits::k30, MortonLayout::kPerAxis, 1), TreeKind::kBvh, 1);
  const auto leaf = [](std::uint32_t i) { return kLeafBit | i; };
  EXPECT_EQ(tree.root.link, 4u);  // keys of 0... and 1...
  EXPECT_EQ(std::pair(tree.nodes[4].left, tree.nodes[4].right), std::pair(2u, 5u));
  EXPECT_EQ(std::pair(tree.nodes[2].left, tree.nodes[2].right), std::pair(1u, 3u));
  EXPECT_EQ(std::pair(tree.nodes[1].left, tree.nodes[1].right), std::pair(0u, leaf(2)));
  EXPECT_EQ(std::pair(tree.nodes[0].left, tree.nodes[0].right), std::pair(leaf(0), leaf(1)));
  EXPECT_EQ(std::pair(tree.nodes[3].left, tree.nodes[3].right), std::pair(leaf(3), leaf(4)));
  EXPECT_EQ(std::pair(tree.nodes[5].left, tree.nodes[5].right), std::pair(leaf(5), 7u));
  EXPECT_EQ(std::pair(tree.nodes[7].left, tree.nodes[7].right), std::pair(6u, 8u));
  EXPECT_EQ(std::pair(tree.nodes[6].left, tree.nodes[6].right), std::pair(leaf(6), leaf(7)));
  EXPECT_EQ(std::pair(tree.nodes[8].left, tree.nodes[8].right), std::pair(leaf(8), leaf(9)));
}

TEST(LbvhTest, TiesOfKarrasLayoutCostVisits) {
  // Two far clusters: nearly all codes are equal, and split by index they overlap.
  const Photons photons = MakeCloud(CloudNamed("two_far_clusters"), 5003, /*seed=*/7);
  const auto area = [&](MortonLayout layout) {
    return ComputeStatistics(
               Arrange(BuildLbvh(photons.positions, MortonBits::k30, layout, 8), TreeKind::kBvh, 8))
        .sah_cost;
  };
  EXPECT_GT(area(MortonLayout::kPerAxis) - 1, 5 * (area(MortonLayout::kCubic) - 1));
}

}  // namespace
}  // namespace treelight
