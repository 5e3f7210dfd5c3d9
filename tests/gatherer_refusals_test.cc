#include <limits>
#include <string>
#include <vector>

#include "core/gatherer.h"
#include "gtest/gtest.h"
#include "tests/map_pair.h"
#include "tests/refused.h"

// Gathers that are refused: each says what is wrong, on the device as by brute force.
namespace treelight {
namespace {

constexpr float kUnlimited = std::numeric_limits<float>::infinity();

struct BadGather {
  const char* name;
  std::vector<float> positions, normals, radii;
  GatherOptions options;
  const char* message;
};

class BadGatherTest : public testing::TestWithParam<BadGather> {};

TEST_P(BadGatherTest, IsRefusedByName) {
  Photons photons = MakeCloud(CloudNamed("uniform"), 100, /*seed=*/7);
  photons.directions.clear();
  if (std::string(GetParam().name) == "NoPowers") photons.powers.clear();
  const MapPair pair = BuildPair(photons);
  for (const Gatherer* map : {pair.device.get(), pair.brute_force.get()}) {
    const auto answer = map->Gather({GetParam().positions, GetParam().normals, GetParam().radii},
                                    GetParam().options);
    ExpectInvalidArgument(answer.status(), GetParam().message);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cases, BadGatherTest,
    testing::Values(
        BadGather{"BothUnlimited",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 0},
                  "k is 0 and radius is unlimited: give k > 0 or a finite radius"},
        BadGather{"RadiiUnlimited",
                  {1, 2, 3},
                  {},
                  {kUnlimited},
                  {.k = 0, .radius = 1},
                  "k is 0 and radii[0] is unlimited: give k > 0 or a finite radius"},
        BadGather{"NegativeRadius",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .radius = -1},
                  "radius is -1, it must be >= 0"},
        BadGather{"NanRadius",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .radius = kNan},
                  "radius is nan, it must be >= 0"},
        BadGather{"NanRadii",
                  {1, 2, 3, 4, 5, 6},
                  {},
                  {1, kNan},
                  {.k = 1},
                  "radii[1] is nan, it must be >= 0"},
        BadGather{
            "FewRadii", {1, 2, 3, 4, 5, 6}, {}, {1}, {.k = 1}, "radii: 1 numbers for 2 queries"},
        BadGather{"LargeK", {1, 2, 3}, {}, {}, {.k = 4097}, "k is 4097, at most 4096 is possible"},
        BadGather{"NoOutputs",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .outputs = 0},
                  "outputs is 0, it must be a sum of known outputs and not 0"},
        BadGather{"UnknownOutput",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .outputs = 64},
                  "outputs is 64, it must be a sum of known outputs and not 0"},
        BadGather{"NanQuery",
                  {1, 2, 3, 4, kNan, 6},
                  {},
                  {},
                  {.k = 1},
                  "positions[4] of query 1 is nan, it must be finite and within 1e+18"},
        BadGather{
            "OddLength", {1, 2}, {}, {}, {.k = 1}, "positions: 2 numbers are no multiple of 3"},
        BadGather{"NoPowers",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .outputs = kOutputDensity},
                  "outputs: DENSITY needs powers; the map has none"},
        BadGather{"NoDirections",
                  {1, 2, 3},
                  {0, 0, 1},
                  {},
                  {.k = 1, .outputs = kOutputDensity},
                  "normals: the map has no directions; build it with directions or leave them out"},
        BadGather{
            "FewNormals", {1, 2, 3}, {0, 0}, {}, {.k = 1}, "normals: 2 numbers for 1 queries"},
        BadGather{"UnknownKernel",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .kernel = DensityKernel{3}},
                  "kernel is 3, no such kernel"},
        BadGather{"NegativeEpsilon",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .approximation = {.epsilon = -0.5f}},
                  "approximation.epsilon is -0.5, it must be finite and >= 0"},
        BadGather{"NanEpsilon",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .approximation = {.epsilon = kNan}},
                  "approximation.epsilon is nan, it must be finite and >= 0"},
        BadGather{"EndlessEpsilon",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .approximation = {.epsilon = kUnlimited}},
                  "approximation.epsilon is inf, it must be finite and >= 0"},
        BadGather{"EpsilonWithoutK",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 0, .radius = 1, .approximation = {.epsilon = 0.5f}},
                  "approximation.epsilon is 0.5, but k is 0: it is for the k nearest, give k > 0"},
        BadGather{"LeavesWithoutK",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 0, .radius = 1, .approximation = {.max_leaves = 7}},
                  "approximation.max_leaves is 7, but k is 0: it is for the k nearest, give k > 0"},
        BadGather{"BoundsOfExact",
                  {1, 2, 3},
                  {},
                  {},
                  {.k = 1, .outputs = kOutputErrorBound},
                  "outputs: ERROR_BOUND is for approximate answers; set a field of approximation"}),
    [](const auto& test) { return test.param.name; });

TEST(GathererRefusalsTest, ListsOverTheLimitAreRefused) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 100, /*seed=*/7);
  const MapPair pair = BuildPair(photons);
  const std::vector<float> positions(3 * 10, 0.5f);
  for (const Gatherer* map : {pair.device.get(), pair.brute_force.get()}) {
    for (const GatherOptions& options :
         {GatherOptions{.k = 0, .radius = 5, .outputs = kOutputNeighbors, .max_neighbors = 999},
          GatherOptions{.k = 100, .outputs = kOutputNeighbors, .max_neighbors = 999}}) {
      const auto answer = map->Gather({positions, {}, {}}, options);
      EXPECT_EQ(answer.status().code(), absl::StatusCode::kResourceExhausted);
      EXPECT_EQ(answer.status().message(),
                "the answer of the batch holds 1000 neighbours, the limit is 999 (max_neighbors); "
                "send fewer queries in a batch, or a smaller k or radius");
    }
    EXPECT_TRUE(
        map->Gather({positions, {}, {}}, {.k = 0, .radius = 5, .outputs = 4, .max_neighbors = 1000})
            .ok());
  }
}

TEST(GathererRefusalsTest, AnswersLargerThanABufferAreRefused) {
  const std::uint64_t limit = TestGpu().device->info().max_buffer_bytes;
  const std::uint64_t query_count = limit / (4 * kMaxNeighbors) + 1;
  if (query_count > 1'000'000) GTEST_SKIP() << "the device takes too many queries to try";
  const Photons photons = MakeCloud(CloudNamed("uniform"), 100, /*seed=*/7);
  const auto map = TestBuilder().Build(photons, {});
  const std::vector<float> positions(3 * query_count, 0.5f);
  const auto answer =
      (*map)->Gather({positions, {}, {}}, {.k = kMaxNeighbors, .outputs = kOutputNeighbors});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kResourceExhausted) << answer.status();
}

}  // namespace
}  // namespace treelight
