#include "core/cpu/traverse.h"

#include <algorithm>
#include <limits>

#include "core/cpu/cpu_builder.h"
#include "core/cpu/tree_gatherer.h"
#include "core/gpu/gpu_gatherer.h"
#include "core/gpu/photon_powers.h"
#include "core/model/morton_grid.h"
#include "core/search_statistics.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/test_device.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

constexpr float kUnlimited = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kAll = kOutputCount | kOutputRadius | kOutputNeighbors | kOutputStatistics;

/// `tree` on the test device, without a wide tree: its visits are of the binary one.
std::unique_ptr<Gatherer> OnDevice(const Tree& tree, const Photons& photons) {
  DeviceMap map;
  map.gpu = TestGpu();
  map.tree.root = tree.root;
  map.tree.nodes = Upload(tree.nodes);
  map.tree.min_ids = Upload(tree.min_ids);
  map.tree.photons = Upload(tree.photons);
  map.powers = UploadPowers(TestGpu(), photons);
  map.grid = Upload<MortonGrid>({MakeMortonGrid({}, 10)});
  map.photon_count = photons.size();
  map.has_powers = !photons.powers.empty();
  map.max_leaf_size = tree.max_leaf_size;
  return MakeGpuGatherer(std::move(map));
}

/// Both maps give the same answers by the same work.
void ExpectTheSame(const Gatherer& cpu, const Gatherer& device, const GatherQueries& queries,
                   const GatherOptions& options) {
  const auto expected = device.Gather(queries, options), actual = cpu.Gather(queries, options);
  ASSERT_TRUE(expected.ok()) << expected.status();
  ASSERT_TRUE(actual.ok()) << actual.status();
  ASSERT_TRUE(SameExactAnswers(*actual, *expected));
  ASSERT_EQ(actual->nodes_visited, expected->nodes_visited);
  ASSERT_EQ(actual->distance_tests, expected->distance_tests);
}

TEST(TraverseTest, VisitsWhatTheDeviceVisits) {
  for (const CloudShape& shape : AllClouds()) {
    const Photons photons = MakeCloud(shape, 3001, /*seed=*/7);
    const Tree tree = *(*TestBuilder().Build(photons, {.max_leaf_size = 8}))->ReadTree();
    const auto device = OnDevice(tree, photons), cpu = MakeTreeGatherer(photons, tree, {});
    const auto positions = MakeQueries(photons, 97, /*seed=*/8);
    const GatherQueries queries{.positions = positions};
    auto radii = cpu->Gather(queries, {.k = 50, .outputs = kOutputRadius})->radii;
    std::sort(radii.begin(), radii.end());
    SCOPED_TRACE(shape.name);
    for (const float radius : {kUnlimited, radii[48], 0.0f}) {
      for (const std::uint32_t k : {1u, 50u}) {
        ExpectTheSame(*cpu, *device, queries, {.k = k, .radius = radius, .outputs = kAll});
      }
    }
    for (const float radius : {2 * radii[48], radii[48], 0.0f}) {
      ExpectTheSame(*cpu, *device, queries, {.k = 0, .radius = radius, .outputs = kAll});
      const GatherOptions density{
          .k = 0, .radius = radius, .outputs = kOutputDensity | kOutputCount | kOutputStatistics};
      ExpectTheSame(*cpu, *device, queries, density);
    }
  }
}

class EveryTreeKind : public testing::TestWithParam<TreeKindOptions> {};

TEST_P(EveryTreeKind, AnswersOnTheDeviceAsOnTheCpu) {
  for (const std::string name : {"surfaces", "half_one_duplicate", "integer_grid", "collinear"}) {
    const Photons photons = MakeCloud(CloudNamed(name), 3001, /*seed=*/7);
    const auto cpu = *MakeCpuBuilder()->Build(photons, GetParam().options);
    const auto device = OnDevice(*cpu->ReadTree(), photons);
    const auto positions = MakeQueries(photons, 97, /*seed=*/8);
    const GatherQueries queries{.positions = positions};
    const float radius = cpu->Gather(queries, {.k = 50, .outputs = kOutputRadius})->radii[0];
    SCOPED_TRACE(name);
    ExpectTheSame(*cpu, *device, queries, {.k = 50, .outputs = kAll});
    ExpectTheSame(*cpu, *device, queries, {.k = 0, .radius = radius, .outputs = kAll});
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryTreeKind, testing::ValuesIn(AllTreeKinds()),
                         [](const auto& test) { return test.param.name; });

TEST(SearchStatisticsTest, AreTheSameOnEveryDevice) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 3001, /*seed=*/7);
  const auto cpu = *MakeCpuBuilder()->Build(photons, {.max_leaf_size = 8});
  const auto device = OnDevice(*cpu->ReadTree(), photons);
  const auto queries = std::span(photons.positions).first(3 * 100);
  const auto expected = MeasureSearches(*device, queries), actual = MeasureSearches(*cpu, queries);
  ASSERT_TRUE(expected.ok()) << expected.status();
  ASSERT_TRUE(actual.ok()) << actual.status();
  EXPECT_EQ(actual->exact_nodes, expected->exact_nodes);
  EXPECT_EQ(actual->knn50_nodes, expected->knn50_nodes);
  EXPECT_EQ(actual->knn50_tests, expected->knn50_tests);
  EXPECT_EQ(actual->r50_nodes, expected->r50_nodes);
  EXPECT_EQ(actual->r50_tests, expected->r50_tests);
}

TEST(SearchStatisticsTest, CountWhatASearchMustDo) {
  // Four photons on a line, leaves of one: a balanced tree of two levels.
  Photons photons;
  for (const float x : {0.0f, 1.0f, 2.0f, 3.0f}) {
    photons.positions.insert(photons.positions.end(), {x, 0, 0});
  }
  const auto map =
      *MakeCpuBuilder()->Build(photons, {.builder = BuilderKind::kBalanced, .max_leaf_size = 1});
  const auto statistics = MeasureSearches(*map, photons.positions);
  ASSERT_TRUE(statistics.ok()) << statistics.status();
  EXPECT_EQ(statistics->exact_nodes, 3);  // root, node, leaf
  EXPECT_EQ(statistics->knn50_nodes, 7);  // fewer than 50: everything
  EXPECT_EQ(statistics->knn50_tests, 4);
  EXPECT_EQ(statistics->r50_nodes, 7);
  EXPECT_EQ(statistics->r50_tests, 4);
  EXPECT_EQ(MeasureSearches(*map, {})->knn50_nodes, 0);
}

}  // namespace
}  // namespace treelight
