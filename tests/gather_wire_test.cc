#include "client/gather_wire.h"

#include <cmath>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::uint32_t kAllOutputs =
    kOutputCount | kOutputRadius | kOutputNeighbors | kOutputDensity | kOutputStatistics;

template <typename T>
std::string Bytes(const std::vector<T>& array) {
  return {reinterpret_cast<const char*>(array.data()), array.size() * sizeof(T)};
}

v1::GatherRequest Request(std::uint32_t k, std::size_t query_count) {
  const std::vector<float> positions(3 * query_count, 0.5f);
  return MakeGatherRequest({.name = "map"}, /*batch_id=*/9,
                           {.positions = positions, .normals = {}, .radii = {}},
                           {.k = k, .radius = 1, .outputs = kAllOutputs});
}

/// A right answer to the queries [first, first + count) of Request(k, 3).
v1::GatherResponse Part(std::uint32_t k, std::uint32_t first, std::uint32_t count) {
  v1::GatherResponse part;
  part.set_batch_id(9);
  part.set_map("map");
  part.set_version(4);
  part.set_first_query(first);
  part.set_query_count(count);
  part.set_last(first + count == 3);
  part.set_counts(Bytes(std::vector<std::uint32_t>(count, 2)));
  part.set_radii(Bytes(std::vector<float>(count, 1)));
  part.set_neighbor_ids(Bytes(std::vector<std::uint32_t>(2 * count, first)));
  part.set_neighbor_squared_distances(Bytes(std::vector<float>(2 * count, 0.25f)));
  if (k == 0) {
    std::vector<std::uint64_t> offsets;
    for (std::uint32_t i = 0; i <= count; ++i) offsets.push_back(2 * i);
    part.set_neighbor_offsets(Bytes(offsets));
  }
  part.set_densities(Bytes(std::vector<float>(3 * count, 7)));
  part.set_nodes_visited(Bytes(std::vector<std::uint32_t>(count, 5)));
  part.set_distance_tests(Bytes(std::vector<std::uint32_t>(count, 6)));
  part.mutable_timings()->set_kernel_us(11);
  part.set_search("by hand");
  return part;
}

TEST(GatherWireTest, ARequestCarriesEveryOption) {
  const std::vector<float> positions = {1, 2, 3}, normals = {0, 0, 1}, radii = {0.5f};
  const GatherOptions options{
      .k = 7,
      .radius = 2,
      .outputs = kOutputDensity,
      .kernel = DensityKernel::kCone,
      .approximation = {.epsilon = 0.5f, .max_leaves = 6, .weight_tolerance = 0.25f}};
  auto request =
      MakeGatherRequest({.name = "m", .version = 3}, 8,
                        {.positions = positions, .normals = normals, .radii = radii}, options);
  EXPECT_EQ(request.map(), "m");
  EXPECT_EQ(request.version(), 3u);
  EXPECT_EQ(request.batch_id(), 8u);
  EXPECT_EQ(request.positions(), Bytes(positions));
  EXPECT_EQ(request.normals(), Bytes(normals));
  EXPECT_EQ(request.radii(), Bytes(radii));
  EXPECT_FALSE(request.has_radius());  // `radii` instead
  EXPECT_EQ(request.k(), 7u);
  EXPECT_EQ(request.outputs(), kOutputDensity);
  EXPECT_EQ(request.kernel(), v1::DENSITY_KERNEL_CONE);
  EXPECT_EQ(request.approximation().epsilon(), 0.5f);
  EXPECT_EQ(request.approximation().max_leaves(), 6u);
  EXPECT_EQ(request.approximation().weight_tolerance(), 0.25f);
  EXPECT_FALSE(Request(/*k=*/1, 1).has_approximation());
  request = MakeGatherRequest({.name = "m"}, 8,
                              {.positions = positions, .normals = {}, .radii = {}}, options);
  EXPECT_EQ(request.radius(), 2);
}

TEST(GatherWireTest, PartsOfUncappedListsGoOnWhereTheLastEnded) {
  AnswerAssembly assembly(Request(/*k=*/0, 3));
  ASSERT_TRUE(assembly.Add(Part(/*k=*/0, 0, 1)).ok());
  EXPECT_FALSE(assembly.complete());
  ASSERT_TRUE(assembly.Add(Part(/*k=*/0, 1, 2)).ok());
  ASSERT_TRUE(assembly.complete());
  const GatherAnswer answer = assembly.Take();
  EXPECT_EQ(answer.map.version, 4u);
  EXPECT_EQ(answer.result.times.kernel_us, 11);
  EXPECT_EQ(answer.search, "by hand");
  EXPECT_THAT(answer.result.counts, ElementsAre(2, 2, 2));
  EXPECT_THAT(answer.result.neighbor_offsets, ElementsAre(0, 2, 4, 6));
  EXPECT_THAT(answer.result.neighbor_ids, ElementsAre(0, 0, 1, 1, 1, 1));
  EXPECT_EQ(answer.result.densities.size(), 9u);
}

TEST(GatherWireTest, ResultsOfBatchesAreJoined) {
  GatherResult whole, part;
  whole.neighbor_ids = {1, 2};
  whole.neighbor_offsets = {0, 2};
  part.neighbor_ids = {3, 4};
  part.neighbor_offsets = {0, 0, 2};
  AppendResult(part, whole);
  EXPECT_THAT(whole.neighbor_offsets, ElementsAre(0, 2, 2, 4));
  EXPECT_THAT(whole.neighbor_ids, ElementsAre(1, 2, 3, 4));
}

struct Damage {
  std::string name;
  std::uint32_t k;
  std::function<void(v1::GatherResponse&)> apply;
  std::string expected;
};

/// What CTest shows of a parameter.
void PrintTo(const Damage& damage, std::ostream* out) { *out << damage.name; }

class DamagedAnswerTest : public testing::TestWithParam<Damage> {};

TEST_P(DamagedAnswerTest, IsInternalAndNamesTheField) {
  auto part = Part(GetParam().k, 0, 3);
  ASSERT_TRUE(AnswerAssembly(Request(GetParam().k, 3)).Add(part).ok());
  GetParam().apply(part);
  const auto status = AnswerAssembly(Request(GetParam().k, 3)).Add(part);
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("malformed answer from the server: " + GetParam().expected));
}

using Response = v1::GatherResponse;
const std::string kLarge = Bytes(std::vector<std::uint64_t>{0, 2, 4, std::uint64_t{1} << 62});

INSTANTIATE_TEST_SUITE_P(
    GatherWire, DamagedAnswerTest,
    testing::Values(
        Damage{"BatchId", 2, [](Response& part) { part.set_batch_id(8); },
               "batch_id is 8, expected 9"},
        Damage{"Map", 2, [](Response& part) { part.set_map("other"); }, "map"},
        Damage{"Version", 2, [](Response& part) { part.set_version(0); }, "version is 0"},
        Damage{"FirstQuery", 2, [](Response& part) { part.set_first_query(1); },
               "first_query is 1, expected 0"},
        Damage{"NoQueries", 2, [](Response& part) { part.set_query_count(0); },
               "query_count is 0, expected 1 to 3"},
        Damage{"ManyQueries", 2, [](Response& part) { part.set_query_count(4); },
               "query_count is 4"},
        Damage{"NotLast", 2, [](Response& part) { part.set_last(false); },
               "last is false with 3 of 3"},
        Damage{"Counts", 2, [](Response& part) { part.mutable_counts()->pop_back(); },
               "counts has 11 bytes, expected 12"},
        Damage{"Radii", 2, [](Response& part) { part.mutable_radii()->push_back(0); },
               "radii has 13 bytes"},
        Damage{"Densities", 2, [](Response& part) { part.clear_densities(); },
               "densities has 0 bytes"},
        Damage{"Nodes", 2, [](Response& part) { part.clear_nodes_visited(); }, "nodes_visited"},
        Damage{"Tests", 2, [](Response& part) { part.clear_distance_tests(); }, "distance_tests"},
        Damage{"Ids", 2, [](Response& part) { part.mutable_neighbor_ids()->pop_back(); },
               "neighbor_ids has 23 bytes"},
        Damage{"Distances", 2, [](Response& part) { part.clear_neighbor_squared_distances(); },
               "neighbor_squared_distances has 0"},
        Damage{"OffsetsUnasked", 2, [](Response& part) { part.set_neighbor_offsets("x"); },
               "neighbor_offsets has 1"},
        Damage{"OffsetsShort", 0,
               [](Response& part) { part.mutable_neighbor_offsets()->resize(24); },
               "neighbor_offsets has 24 bytes, expected 32"},
        Damage{"OffsetsFall", 0,
               [](Response& part) {
                 part.set_neighbor_offsets(Bytes(std::vector<std::uint64_t>{0, 4, 2, 6}));
               },
               "neighbor_offsets do not rise from 0"},
        Damage{"OffsetsFromOne", 0,
               [](Response& part) {
                 part.set_neighbor_offsets(Bytes(std::vector<std::uint64_t>{1, 2, 4, 6}));
               },
               "neighbor_offsets do not rise from 0"},
        Damage{"OffsetsHuge", 0, [](Response& part) { part.set_neighbor_offsets(kLarge); },
               "neighbor_ids has 24 bytes for 4611686018427387904 neighbours"}),
    [](const auto& instance) { return instance.param.name; });

TEST(GatherWireTest, AnotherVersionInTheMiddleIsInternal) {
  AnswerAssembly assembly(Request(/*k=*/2, 3));
  ASSERT_TRUE(assembly.Add(Part(/*k=*/2, 0, 1)).ok());
  auto part = Part(/*k=*/2, 1, 2);
  part.set_version(5);
  const auto status = assembly.Add(part);
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(status.message()), HasSubstr("version is 5, expected 4"));
}

TEST(GatherWireTest, UnequalArraysAreRefused) {
  const std::vector<float> four(4), three(3), two(2);
  const auto message = [](const GatherQueries& queries) {
    return std::string(CheckQueries(queries, {}).message());
  };
  EXPECT_EQ(message({.positions = four, .normals = {}, .radii = {}}),
            "positions: 4 numbers are no multiple of 3");
  EXPECT_EQ(message({.positions = three, .normals = two, .radii = {}}),
            "normals: 2 numbers for 1 queries");
  EXPECT_EQ(message({.positions = three, .normals = {}, .radii = two}),
            "radii: 2 numbers for 1 queries");
}

}  // namespace
}  // namespace treelight::client
