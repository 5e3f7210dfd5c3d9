#include <algorithm>
#include <random>

#include "core/gpu/sweep.h"
#include "gtest/gtest.h"
#include "tests/test_device.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

/// The tree of the device, which must be that of the plain sweep on the CPU.
void CheckHybrid(const Photons& photons, const BuildOptions& options) {
  const auto actual = TestBuilder().Build(photons, options);
  ASSERT_TRUE(actual.ok()) << actual.status();
  const auto& stages = (*actual)->report().stages;
  ASSERT_TRUE(std::any_of(stages.begin(), stages.end(), [](const StageTime& stage) {
    return stage.stage == "sweep";
  })) << "not built on the device";
  const Tree tree = *(*actual)->ReadTree();
  const absl::Status status = ValidateTree(tree, photons);
  ASSERT_TRUE(status.ok()) << status;
  const auto expected = MakeCpuBuilder()->Build(photons, options);
  ASSERT_TRUE(SameTree(tree, *(*expected)->ReadTree()));
}

struct Sizes {
  std::uint32_t max_leaf_size, subtree_size;
};

class GpuSweepTest : public testing::TestWithParam<Sizes> {};

TEST_P(GpuSweepTest, IsThePlainSweepOnEveryCloud) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 7, 65, 1030}) {
      const Photons photons = MakeCloud(shape, size, /*seed=*/7);
      for (const LeafTerm leaf_term : {LeafTerm::kNone, LeafTerm::kLeafSize}) {
        SCOPED_TRACE(shape.name + " " + std::to_string(size));
        CheckHybrid(photons, {.builder = BuilderKind::kHybrid,
                              .max_leaf_size = GetParam().max_leaf_size,
                              .leaf_term = leaf_term,
                              .subtree_size = GetParam().subtree_size});
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, GpuSweepTest,
                         testing::Values(Sizes{1, 64}, Sizes{1, 512}, Sizes{8, 256}, Sizes{3, 100},
                                         Sizes{8, 8}, Sizes{64, 1024}),
                         [](const auto& test) {
                           return "Leaf" + std::to_string(test.param.max_leaf_size) + "Subtree" +
                                  std::to_string(test.param.subtree_size);
                         });

TEST(GpuSweepTest, IsThePlainSweepByEveryHeuristicOnAFreshCloud) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  for (const CloudShape& shape : AllClouds()) {
    const Photons photons = MakeCloud(shape, 1000 + seed % 3000, seed);
    for (const Heuristic heuristic : {Heuristic::kSah, Heuristic::kIsa, Heuristic::kVvh}) {
      SCOPED_TRACE(shape.name);
      CheckHybrid(photons,
                  {.builder = BuilderKind::kHybrid, .heuristic = heuristic, .radius = 0.01f});
    }
  }
}

}  // namespace
}  // namespace treelight
