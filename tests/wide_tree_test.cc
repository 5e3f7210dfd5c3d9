#include "core/gpu/wide_tree.h"

#include "core/gpu/hierarchy.h"
#include "core/gpu/statistics.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/same_wide_tree.h"
#include "tests/test_device.h"
#include "tests/wide_reference.h"

namespace treelight {
namespace {

TEST(WideTreeTest, KernelsAgreeWithReference) {
  if (!TestGpu().device->has_sub_groups()) GTEST_SKIP() << "the test device has no sub-groups";
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 31, 32, 33, 1024, 1025, 50021, 300007}) {
      for (const std::uint32_t max_leaf_size : {1u, 16u, 64u}) {
        if (size > 100000 && max_leaf_size != 16) continue;
        SCOPED_TRACE(shape.name + " " + std::to_string(size));
        SortedCloud cloud = SortCloud(shape, size, 30);
        reference::BreakTies(cloud.positions, 30, max_leaf_size, cloud.ids, cloud.levels);
        const auto firsts = reference::LeafFirsts(cloud.levels, size, max_leaf_size);
        const auto photons = InLeafOrder(cloud);
        const Tree tree = reference::Hierarchy(cloud.levels, firsts, photons, max_leaf_size);

        const Leaves leaves{firsts.size() - 1, Upload(firsts)};
        const auto levels = Upload(cloud.levels);
        DeviceTree device_tree = BuildHierarchy(TestGpu(), levels, leaves, Upload(photons));
        SumStatistics(TestGpu(), leaves.leaf_count, /*radius=*/0.1f, device_tree);
        const DeviceWideTree wide = BuildWideTree(TestGpu(), device_tree, leaves, levels);
        ASSERT_TRUE(SameWideTree(wide.boxes.Read(TestGpu().queue()), wide.shape,
                                 wide.sizes.Read(TestGpu().queue())[0],
                                 reference::MakeWideTree(tree, cloud.levels)));
      }
    }
  }
}

}  // namespace
}  // namespace treelight
