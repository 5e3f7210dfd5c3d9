#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/server_fixture.h"

namespace treelight::testing {
namespace {

constexpr std::uint32_t kAllOutputs =
    kOutputCount | kOutputRadius | kOutputNeighbors | kOutputDensity | kOutputStatistics;

class ServiceTest : public ServerTest {
 protected:
  ServiceTest() { Start(); }
};

TEST_F(ServiceTest, GatherAgreesWithBruteForce) {
  const Photons photons = MakePhotons(2357, 1);
  const auto points = MakePoints(101, 2);
  MustBuild("cloud", photons);
  const GatherOptions options{.k = 7, .radius = 0.1f, .outputs = kAllOutputs};
  const GatherResult expected = Expected(photons, points, options);

  v1::GatherRequest request = MakeBatch("cloud", points, options);
  request.set_batch_id(42);
  v1::GatherResponse response;
  grpc::ClientContext context;
  const auto status = stub_->Gather(&context, request, &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response.batch_id(), 42u);
  EXPECT_EQ(response.map(), "cloud");
  EXPECT_EQ(response.version(), 1u);
  EXPECT_EQ(response.first_query(), 0u);
  EXPECT_EQ(response.query_count(), 101u);
  EXPECT_TRUE(response.last());
  EXPECT_EQ(Array<std::uint32_t>(response.counts()), expected.counts);
  EXPECT_EQ(Array<float>(response.radii()), expected.radii);
  EXPECT_EQ(Array<std::uint32_t>(response.neighbor_ids()), expected.neighbor_ids);
  EXPECT_EQ(Array<float>(response.neighbor_squared_distances()),
            expected.neighbor_squared_distances);
  EXPECT_EQ(Array<float>(response.densities()), expected.densities);
  EXPECT_EQ(Array<std::uint32_t>(response.nodes_visited()), expected.nodes_visited);
  EXPECT_EQ(Array<std::uint32_t>(response.distance_tests()), expected.distance_tests);
  EXPECT_TRUE(response.neighbor_offsets().empty());
  EXPECT_GT(response.timings().total_us(), 0);
  EXPECT_FALSE(response.search().empty());
}

TEST_F(ServiceTest, StreamAnswersBatchesInOrder) {
  const Photons photons = MakePhotons(503, 3);
  MustBuild("cloud", photons);
  const GatherOptions options{.k = 3, .outputs = kOutputNeighbors};
  std::vector<v1::GatherRequest> batches;
  for (std::uint32_t i = 0; i < 9; ++i) {
    batches.push_back(MakeBatch("cloud", MakePoints(1 + 100 * i, i), options));
    batches.back().set_batch_id(i);
  }
  std::vector<v1::GatherResponse> parts;
  const auto status = Stream(*stub_, batches, parts);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(parts.size(), batches.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    EXPECT_EQ(parts[i].batch_id(), i);
    EXPECT_TRUE(parts[i].last());
    EXPECT_EQ(Array<std::uint32_t>(parts[i].neighbor_ids()),
              Expected(photons, Array<float>(batches[i].positions()), options).neighbor_ids);
  }
}

}  // namespace
}  // namespace treelight::testing
