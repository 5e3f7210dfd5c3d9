#include <vector>

#include "tests/gated_service.h"

// What the request log says about calls that are answered.
namespace treelight::testing {
namespace {

using ServiceLogTest = GatedServiceTest;

TEST_F(ServiceLogTest, AStreamWithoutBatchesIsLogged) {
  StartGated();
  std::vector<v1::GatherResponse> parts;
  ASSERT_TRUE(Stream(*stub_, {}, parts).ok());
  const auto log = LogOf("GatherStream");
  EXPECT_EQ(log["code"], "OK");
  EXPECT_FALSE(log.contains("queries"));
}

TEST_F(ServiceLogTest, TheLogOfALookTellsTheVersionThatAnswered) {
  StartGated();
  v1::GetPhotonMapRequest request;
  request.set_name("cloud");
  v1::PhotonMap map;
  grpc::ClientContext context;
  ASSERT_TRUE(stub_->GetPhotonMap(&context, request, &map).ok());
  EXPECT_EQ(LogOf("GetPhotonMap")["version"], 1);
}

TEST_F(ServiceLogTest, TheLogTellsWhatTheAnswerTells) {
  StartGated();
  auto request = MakeBatch("cloud", {0, 0, 0, 1, 1, 1}, {.k = 3, .outputs = kOutputStatistics});
  request.clear_radius();
  grpc::ClientContext context;
  context.AddMetadata("x-request-id", "frame-7");
  v1::GatherResponse response;
  ASSERT_TRUE(stub_->Gather(&context, request, &response).ok());
  const auto log = LogOf("Gather");
  EXPECT_EQ(log["request_id"], "frame-7");
  EXPECT_EQ(log["map"], "cloud");
  EXPECT_EQ(log["version"], 1);
  EXPECT_EQ(log["queries"], 2);
  EXPECT_EQ(log["k"], 3);
  EXPECT_EQ(log["r"], "inf");
  EXPECT_EQ(log["bytes_in"], request.ByteSizeLong());
  EXPECT_EQ(log["bytes_out"], response.ByteSizeLong());
  EXPECT_EQ(log["distance_tests"], 2000);
  EXPECT_EQ(log["nodes_visited"], 0);
  EXPECT_EQ(log["code"], "OK");
  EXPECT_NEAR(log["queue_us"].get<double>(), response.timings().queue_us(), 0.06);
  EXPECT_NEAR(log["total_us"].get<double>(), response.timings().total_us(), 0.06);
}

}  // namespace
}  // namespace treelight::testing
