#include "core/gpu/leaves.h"

#include <cmath>

#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

TEST(LeavesTest, KernelAgreesWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 2, 3, 16, 17, 255, 256, 257, 20011}) {
      SortedCloud cloud = SortCloud(shape, size, 30);
      for (const std::uint32_t max_leaf_size : {1u, 2u, 8u, 16u, 64u}) {
        reference::BreakTies(cloud.positions, 30, max_leaf_size, cloud.ids, cloud.levels);
        const Leaves leaves = FindLeaves(TestGpu(), Upload(cloud.levels), size, max_leaf_size);
        const auto expected = reference::LeafFirsts(cloud.levels, size, max_leaf_size);
        ASSERT_EQ(leaves.leaf_count, expected.size() - 1)
            << shape.name << " " << size << " " << max_leaf_size;
        ASSERT_EQ(leaves.firsts.Read(TestGpu().queue()), expected) << shape.name << " " << size;
        cloud = SortCloud(shape, size, 30);
      }
    }
  }
}

TEST(LeavesTest, PhotonsGoToLeafOrder) {
  for (const std::size_t size : kSizes) {
    const SortedCloud cloud = SortCloud(CloudNamed("signed_zeros"), size, 30);
    const auto photons = PermutePhotons(TestGpu(), Upload(cloud.positions), Upload(cloud.ids), size)
                             .Read(TestGpu().queue());
    ASSERT_EQ(photons.size(), size);
    for (std::size_t i = 0; i < size; ++i) {
      const std::uint32_t id = cloud.ids[i];
      ASSERT_EQ(photons[i].id, id);
      ASSERT_EQ(photons[i].x, cloud.positions[3 * id]);
      ASSERT_FALSE(std::signbit(photons[i].x)) << "-0 has become +0";
      ASSERT_EQ(photons[i].y, cloud.positions[3 * id + 1]);
      ASSERT_EQ(photons[i].z, cloud.positions[3 * id + 2]);
    }
  }
}

}  // namespace
}  // namespace treelight
