#include "tests/tree_kinds.h"

#include <string>

#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

/// Fails unless the device builds the tree that the CPU builds, bit by bit, and tells the same of
/// it.
void ExpectTheTreeOfTheCpu(const Photons& photons, const BuildOptions& options) {
  const auto expected = MakeCpuBuilder()->Build(photons, options);
  ASSERT_TRUE(expected.ok()) << expected.status();
  const auto actual = TestBuilder().Build(photons, options);
  ASSERT_TRUE(actual.ok()) << actual.status();
  const Tree tree = *(*actual)->ReadTree();
  ASSERT_TRUE(SameTree(tree, *(*expected)->ReadTree()));
  EXPECT_EQ(tree.kind, (*expected)->ReadTree()->kind);
  const BuildReport& report = (*actual)->report();
  const TreeStatistics& plain = (*expected)->report().tree;
  EXPECT_EQ(report.builder, (*expected)->report().builder);
  EXPECT_EQ(report.radius, (*expected)->report().radius);
  EXPECT_EQ(report.tree.depth, plain.depth);
  EXPECT_NEAR(report.tree.sah_cost, plain.sah_cost, 1e-5 * plain.sah_cost);
  EXPECT_NEAR(report.tree.isa_cost, plain.isa_cost, 1e-5 * plain.isa_cost);
}

class EveryTreeKind : public testing::TestWithParam<TreeKindOptions> {};

TEST_P(EveryTreeKind, IsTheTreeOfTheCpu) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {0, 1, 2, 8, 9, 300, 1501}) {
      SCOPED_TRACE(shape.name + " " + std::to_string(size));
      ExpectTheTreeOfTheCpu(MakeCloud(shape, size, /*seed=*/7), GetParam().options);
    }
  }
}

TEST_P(EveryTreeKind, IsTheTreeOfTheCpuWhereManyGroupsMeet) {
  for (const char* cloud : {"surfaces", "half_one_duplicate"}) {
    SCOPED_TRACE(cloud);
    ExpectTheTreeOfTheCpu(MakeCloud(CloudNamed(cloud), 50021, /*seed=*/7), GetParam().options);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryTreeKind, testing::ValuesIn(AllTreeKinds()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace treelight
