#include "core/gpu/hierarchy.h"

#include <cstring>

#include "core/gpu/split_levels.h"
#include "core/gpu/statistics.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

template <typename T>
bool SameBits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

TEST(HierarchyTest, KernelAgreesWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 2, 16, 17, 255, 256, 257, 50021}) {
      for (const std::uint32_t max_leaf_size : {1u, 16u}) {
        SortedCloud cloud = SortCloud(shape, size, 30);
        reference::BreakTies(cloud.positions, 30, max_leaf_size, cloud.ids, cloud.levels);
        const auto firsts = reference::LeafFirsts(cloud.levels, size, max_leaf_size);
        const auto photons = InLeafOrder(cloud);
        const Tree expected = reference::Hierarchy(cloud.levels, firsts, photons, max_leaf_size);
        DeviceTree tree = BuildHierarchy(TestGpu(), Upload(cloud.levels),
                                         {firsts.size() - 1, Upload(firsts)}, Upload(photons));
        SCOPED_TRACE(shape.name + " " + std::to_string(size));
        const TreeStatistics statistics =
            SumStatistics(TestGpu(), firsts.size() - 1, /*radius=*/0.1f, tree);
        ASSERT_EQ(std::memcmp(&tree.root, &expected.root, sizeof tree.root), 0);
        ASSERT_TRUE(SameBits(tree.nodes.Read(TestGpu().queue()), expected.nodes));
        ASSERT_EQ(tree.min_ids.Read(TestGpu().queue()), expected.min_ids);

        const TreeStatistics plain = ComputeStatistics(expected, 0.1f);
        EXPECT_EQ(statistics.node_count, plain.node_count);
        EXPECT_EQ(statistics.leaf_count, plain.leaf_count);
        EXPECT_EQ(statistics.depth, plain.depth);
        EXPECT_NEAR(statistics.mean_leaf_depth, plain.mean_leaf_depth, 1e-9);
        EXPECT_EQ(statistics.leaf_fill, plain.leaf_fill);
        EXPECT_NEAR(statistics.sah_cost, plain.sah_cost, 1e-5 * plain.sah_cost);
        EXPECT_NEAR(statistics.isa_cost, plain.isa_cost, 1e-5 * plain.isa_cost);
      }
    }
  }
}

// Karras 2012, figure 3: eight 5-bit keys; its internal nodes cover the leaves [0,7], [0,3], [4,7],
// [0,1], [2,3], [5,7] and [5,6].
TEST(HierarchyTest, WorkedExampleOfKarras) {
  const std::vector<cl_uint> keys = {0b00001, 0b00010, 0b00100, 0b00101,
                                     0b10011, 0b11000, 0b11001, 0b11110};
  std::vector<cl_uint> codes;
  for (const cl_uint key : keys) codes.push_back(key << 25);
  const Buffer<cl_uchar> levels(TestGpu().memory(), 7);
  ComputeSplitLevels(TestGpu(), Upload(codes), 8, levels);
  EXPECT_EQ(levels.Read(TestGpu().queue()), (std::vector<cl_uchar>{3, 2, 4, 0, 1, 4, 2}));

  const Leaves leaves = FindLeaves(TestGpu(), levels, 8, /*max_leaf_size=*/1);
  ASSERT_EQ(leaves.leaf_count, 8u);
  std::vector<LeafPhoton> photons;
  for (std::uint32_t i = 0; i < 8; ++i) photons.push_back({static_cast<float>(i), 0, 0, i});
  DeviceTree tree = BuildHierarchy(TestGpu(), levels, leaves, Upload(photons));
  SumStatistics(TestGpu(), leaves.leaf_count, /*radius=*/0.1f, tree);
  const auto nodes = tree.nodes.Read(TestGpu().queue());
  const auto leaf = [](std::uint32_t i) { return kLeafBit | i; };
  // Node i separates leaf i from leaf i + 1.
  EXPECT_EQ(tree.root.link, 3u);  // [0,7] splits after leaf 3
  EXPECT_EQ(std::pair(nodes[3].left, nodes[3].right), std::pair(1u, 4u));
  EXPECT_EQ(std::pair(nodes[1].left, nodes[1].right), std::pair(0u, 2u));            // [0,3]
  EXPECT_EQ(std::pair(nodes[0].left, nodes[0].right), std::pair(leaf(0), leaf(1)));  // [0,1]
  EXPECT_EQ(std::pair(nodes[2].left, nodes[2].right), std::pair(leaf(2), leaf(3)));  // [2,3]
  EXPECT_EQ(std::pair(nodes[4].left, nodes[4].right), std::pair(leaf(4), 6u));       // [4,7]
  EXPECT_EQ(std::pair(nodes[6].left, nodes[6].right), std::pair(5u, leaf(7)));       // [5,7]
  EXPECT_EQ(std::pair(nodes[5].left, nodes[5].right), std::pair(leaf(5), leaf(6)));  // [5,6]
}

}  // namespace
}  // namespace treelight
