#include "client/photon_map_client.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "grpc/grpc.h"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

using ::testing::HasSubstr;
using ::treelight::testing::MakePhotons;
using ::treelight::testing::MakePoints;

constexpr std::uint32_t kAllOutputs =
    kOutputCount | kOutputRadius | kOutputNeighbors | kOutputDensity | kOutputStatistics;
constexpr std::chrono::seconds kTimeout{60};  // a deadlock fails instead of hanging

class PhotonMapClientTest : public treelight::testing::ServerTest {
 protected:
  /// Starts a server and connects; options_ may be changed before.
  void Connect() {
    Start();
    client_ = std::make_unique<PhotonMapClient>(server_->InProcessChannel(), kTimeout);
  }

  std::uint64_t Build(const Photons& photons) {
    const auto built = client_->BuildPhotonMap("map", photons);
    EXPECT_TRUE(built.ok()) << built.status();
    return built.ok() ? built->map().version() : 0;
  }

  std::unique_ptr<PhotonMapClient> client_;
};

GatherQueries Queries(const std::vector<float>& positions) {
  return {.positions = positions, .normals = {}, .radii = {}};
}

void ExpectSameBits(const GatherResult& actual, const GatherResult& expected) {
  EXPECT_EQ(actual.counts, expected.counts);
  EXPECT_EQ(actual.radii, expected.radii);
  EXPECT_EQ(actual.neighbor_ids, expected.neighbor_ids);
  EXPECT_EQ(actual.neighbor_squared_distances, expected.neighbor_squared_distances);
  EXPECT_EQ(actual.neighbor_offsets, expected.neighbor_offsets);
  EXPECT_EQ(actual.densities, expected.densities);  // the server runs the same brute force
}

// Its last shutdown may take ten seconds.
TEST(PhotonMapClient, LeavesGrpcInitialised) {
  auto client = PhotonMapClient::Connect("unix:/nobody/listens", {});
  ASSERT_TRUE(client.ok()) << client.status();
  client->reset();
  EXPECT_NE(grpc_is_initialized(), 0);
}

TEST_F(PhotonMapClientTest, GathersOfAnySizeAgreeWithBruteForce) {
  options_.limits.max_queries = 100;
  Connect();
  const Photons photons = MakePhotons(2'003, /*seed=*/1);
  const std::uint64_t version = Build(photons);
  for (const GatherOptions& options :
       {GatherOptions{.k = 0, .radius = 0.1f, .outputs = kAllOutputs},
        GatherOptions{.k = 7, .radius = 0.08f, .outputs = kAllOutputs},
        GatherOptions{.k = 1, .outputs = kAllOutputs},
        GatherOptions{.k = 0, .radius = 0.2f, .outputs = kOutputCount}}) {
    for (const std::size_t query_count : {0, 1, 2, 99, 100, 101, 1'009}) {
      const auto positions = MakePoints(query_count, /*seed=*/2);
      const auto answer = client_->Gather({.name = "map"}, Queries(positions), options);
      ASSERT_TRUE(answer.ok()) << answer.status();
      EXPECT_EQ(answer->map.version, version);
      ExpectSameBits(answer->result, Expected(photons, positions, options));
      const bool statistics = (options.outputs & kOutputStatistics) != 0;
      EXPECT_EQ(answer->result.distance_tests.size(), statistics ? query_count : 0);
    }
  }
}

TEST_F(PhotonMapClientTest, NormalsAndRadiiStayWithTheirQueries) {
  options_.limits.max_queries = 10;
  Connect();
  const Photons photons = MakePhotons(500, /*seed=*/3);
  Build(photons);
  const auto positions = MakePoints(35, /*seed=*/4), normals = MakePoints(35, /*seed=*/5);
  auto radii = MakePoints(12, /*seed=*/6);
  radii.resize(35);
  const GatherQueries queries{.positions = positions, .normals = normals, .radii = radii};
  const GatherOptions options{.k = 20, .outputs = kOutputRadius | kOutputDensity};
  const auto answer = client_->Gather({.name = "map"}, queries, options);
  ASSERT_TRUE(answer.ok()) << answer.status();
  const auto map = MakeBruteForceBuilder()->Build(photons, {});
  const auto expected = (*map)->Gather(queries, options);
  ASSERT_TRUE(expected.ok()) << expected.status();
  ExpectSameBits(answer->result, *expected);
}

TEST_F(PhotonMapClientTest, UncappedListsOverTheLimitOfABatchAreCutByTheirCounts) {
  options_.limits.max_neighbors = 300;
  Connect();
  const Photons photons = MakePhotons(3'000, /*seed=*/7);
  Build(photons);
  const auto positions = MakePoints(200, /*seed=*/8);
  const GatherOptions options{.k = 0, .radius = 0.15f, .outputs = kOutputNeighbors};
  const GatherResult expected = Expected(photons, positions, options);
  ASSERT_GT(expected.neighbor_ids.size(), 10 * options_.limits.max_neighbors);
  const auto answer = client_->Gather({.name = "map"}, Queries(positions), options);
  ASSERT_TRUE(answer.ok()) << answer.status();
  ExpectSameBits(answer->result, expected);
}

TEST_F(PhotonMapClientTest, AListOverTheLimitIsRefusedWithTheServersMessage) {
  options_.limits.max_neighbors = 50;
  Connect();
  Build(MakePhotons(100, /*seed=*/9));
  const auto positions = MakePoints(3, /*seed=*/10);
  const auto answer = client_->Gather({.name = "map"}, Queries(positions),
                                      {.k = 0, .radius = 9, .outputs = kOutputNeighbors});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kResourceExhausted) << answer.status();
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("50"));
}

TEST_F(PhotonMapClientTest, AllPartsAreAnsweredByOneVersionWhileOthersAreBuilt) {
  options_.limits.max_queries = 5;
  Connect();
  std::map<std::uint64_t, Photons> versions;
  for (int seed = 0; seed < 3; ++seed) {
    const Photons photons = MakePhotons(300, seed);
    versions[Build(photons)] = photons;
  }
  std::atomic<bool> stop = false;
  std::jthread builder([&] {
    while (!stop) Build(versions.rbegin()->second);
  });
  const auto positions = MakePoints(400, /*seed=*/11);
  const GatherOptions options{.k = 3, .outputs = kOutputNeighbors};
  const GatherResult expected = Expected(versions.rbegin()->second, positions, options);
  for (int round = 0; round < 5; ++round) {
    const auto newest =
        client_->Gather({.name = "map"}, Queries(positions), options);  // checks versions of parts
    ASSERT_TRUE(newest.ok()) << newest.status();
    EXPECT_GE(newest->map.version, versions.rbegin()->first);
    ExpectSameBits(newest->result, expected);
    for (const auto& [version, photons] : versions) {
      const auto pinned =
          client_->Gather({.name = "map", .version = version}, Queries(positions), options);
      ASSERT_TRUE(pinned.ok()) << pinned.status();
      EXPECT_EQ(pinned->map.version, version);
      ExpectSameBits(pinned->result, Expected(photons, positions, options));
    }
  }
  stop = true;
}

TEST_F(PhotonMapClientTest, ErrorsOfLaterBatchesSayWhereTheyAre) {
  options_.limits.max_queries = 100;
  Connect();
  Build(MakePhotons(50, /*seed=*/12));
  auto positions = MakePoints(1'000, /*seed=*/13);
  positions[3 * 250 + 1] = NAN;
  const auto answer = client_->Gather({.name = "map"}, Queries(positions), {.k = 1});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("query 50"));
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("(counted from query 200)"));
}

TEST_F(PhotonMapClientTest, PipelinesAnswerInOrderAndNeverWaitForEachOther) {
  Connect();
  const Photons photons = MakePhotons(300, /*seed=*/14);
  Build(photons);
  const GatherOptions options{.k = 200, .outputs = kOutputNeighbors};
  GatherPipeline pipeline(*client_, {.name = "map"}, options);
  // Requests of 600 kB and answers of 80 MB: the server could not send them all if nobody read.
  std::vector<std::vector<float>> batches;
  for (int batch = 0; batch < 25; ++batch) {
    batches.push_back(MakePoints(2'000, /*seed=*/100 + batch));
    ASSERT_TRUE(pipeline.Send(Queries(batches.back())).ok());
  }
  for (const auto& positions : batches) {
    const auto answer = pipeline.Receive();
    ASSERT_TRUE(answer.ok()) << answer.status();
    ExpectSameBits(answer->result, Expected(photons, positions, options));
  }
  EXPECT_EQ(pipeline.Receive().status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(PhotonMapClientTest, APipelineEndsWithTheErrorOfItsBatch) {
  Connect();
  Build(MakePhotons(10, /*seed=*/15));
  GatherPipeline pipeline(*client_, {.name = "map"}, {.k = 1});
  const std::vector<float> good = {0, 0, 0}, bad = {0, INFINITY, 0};
  ASSERT_TRUE(pipeline.Send(Queries(good)).ok());
  ASSERT_TRUE(pipeline.Send(Queries(bad)).ok());
  EXPECT_TRUE(pipeline.Receive().ok());
  EXPECT_EQ(pipeline.Receive().status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(pipeline.Send(Queries(good)).code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(PhotonMapClientTest, APipelineMayBeDroppedWithAnswersOnTheirWay) {
  Connect();
  Build(MakePhotons(2'000, /*seed=*/16));
  const auto positions = MakePoints(5'000, /*seed=*/17);
  for (int round = 0; round < 5; ++round) {
    GatherPipeline pipeline(*client_, {.name = "map"}, {.k = 50, .outputs = kOutputNeighbors});
    ASSERT_TRUE(pipeline.Send(Queries(positions)).ok());
  }
  EXPECT_TRUE(client_->GetServerInfo().ok());
}

TEST_F(PhotonMapClientTest, UploadsKeepToTheServersChunks) {
  options_.limits.max_chunk_bytes = 1000;
  Connect();
  const Photons photons = MakePhotons(1'009, /*seed=*/18);
  std::vector<std::uint64_t> sent;
  const auto built = client_->BuildPhotonMap(
      "map", photons, {.progress = [&](std::uint64_t count) { sent.push_back(count); }});
  ASSERT_TRUE(built.ok()) << built.status();
  EXPECT_EQ(built->map().photon_count(), 1'009u);
  EXPECT_TRUE(built->map().has_powers());
  EXPECT_EQ(sent.size(), 29u);  // 35 photons of 28 B each
  EXPECT_EQ(sent.back(), 1'009u);
}

TEST_F(PhotonMapClientTest, ARepeatedRequestIdGivesTheSameMap) {
  Connect();
  const Photons photons = MakePhotons(100, /*seed=*/19);
  const auto first = client_->BuildPhotonMap("map", photons, {.request_id = "same"});
  const auto second = client_->BuildPhotonMap("map", photons, {.request_id = "same"});
  const auto other = client_->BuildPhotonMap("map", photons);
  ASSERT_TRUE(first.ok() && second.ok() && other.ok());
  EXPECT_EQ(first->map().version(), second->map().version());
  EXPECT_GT(other->map().version(), first->map().version());
}

TEST_F(PhotonMapClientTest, UploadOptionsReachTheServer) {
  Connect();
  UploadOptions options{.time_to_live = std::chrono::hours(1)};
  options.build.set_max_leaf_size(5);
  options.build.set_morton_bits(63);
  const auto built = client_->BuildPhotonMap("map", MakePhotons(100, /*seed=*/20), options);
  ASSERT_TRUE(built.ok()) << built.status();
  EXPECT_EQ(built->map().options().max_leaf_size(), 5u);
  EXPECT_EQ(built->map().options().morton_bits(), 63u);
  EXPECT_EQ(built->map().expires_unix_ms() - built->map().created_unix_ms(), 3'600'000);
}

TEST_F(PhotonMapClientTest, MapsAreListedDescribedAndDeleted) {
  Connect();
  const std::uint64_t first = Build(MakePhotons(10, /*seed=*/21));
  const std::uint64_t second = Build(MakePhotons(20, /*seed=*/22));
  const auto maps = client_->ListPhotonMaps();
  ASSERT_TRUE(maps.ok()) << maps.status();
  ASSERT_EQ(maps->size(), 2u);
  EXPECT_EQ((*maps)[0].photon_count(), 10u);
  EXPECT_EQ(client_->GetPhotonMap({.name = "map"})->version(), second);
  EXPECT_EQ(client_->GetPhotonMap({.name = "map", .version = first})->photon_count(), 10u);
  EXPECT_EQ(*client_->DeletePhotonMap({.name = "map", .version = first}), 1u);
  const auto gone = client_->GetPhotonMap({.name = "map", .version = first});
  EXPECT_EQ(gone.status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(client_->GetServerInfo()->map_count(), 1u);
}

TEST_F(PhotonMapClientTest, ErrorsAreTyped) {
  Connect();
  const std::vector<float> point = {0, 0, 0};
  EXPECT_EQ(client_->Gather({.name = "none"}, Queries(point), {.k = 1}).status().code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(client_->BuildPhotonMap("map", {}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(client_->BuildPhotonMap("a name", MakePhotons(1, /*seed=*/23)).status().code(),
            absl::StatusCode::kInvalidArgument);
  Photons unequal = MakePhotons(2, /*seed=*/24);
  unequal.powers.pop_back();
  const auto refused = client_->BuildPhotonMap("map", unequal);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("powers: 5 numbers, expected 6"));
  EXPECT_TRUE(client_->ListPhotonMaps()->empty());
}

TEST(PhotonMapClientWithoutServerTest, FailsAtOnce) {
  PhotonMapClient client("127.0.0.1:1");
  const auto began = std::chrono::steady_clock::now();
  EXPECT_EQ(client.GetServerInfo().status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(client.BuildPhotonMap("map", MakePhotons(1, 1)).status().code(),
            absl::StatusCode::kUnavailable);
  const std::vector<float> point = {0, 0, 0};
  GatherPipeline pipeline(client, {.name = "map"}, {.k = 1});
  auto status = pipeline.Send(Queries(point));
  if (status.ok())
    status = pipeline.Receive().status();  // it was sent before the connection failed
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(5));
}

}  // namespace
}  // namespace treelight::client
