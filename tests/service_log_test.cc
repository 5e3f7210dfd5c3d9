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

TEST_F(ServiceLogTest, AWrongNameOfAMessagesLengthIsCut) {
  StartGated();
  grpc::ClientContext context;
  v1::GatherResponse response;
  const std::string name(1'000'000, '\1');
  EXPECT_FALSE(stub_->Gather(&context, MakeBatch(name, {0, 0, 0}, {.k = 1}), &response).ok());
  EXPECT_EQ(LogOf("Gather")["map"], name.substr(0, 128) + "...");
}

TEST_F(ServiceLogTest, ABuildIsLoggedWithItsOptionsAndItsTree) {
  Start(MakeCpuBuilder());
  auto upload = MakeUpload("judged", MakePhotons(1000, 1));
  v1::BuildOptions& options = *upload[0].mutable_header()->mutable_options();
  options.set_builder(v1::BUILDER_KIND_TREELET);
  options.set_max_leaf_size(8);
  options.set_rounds(1);
  v1::BuildPhotonMapResponse response;
  ASSERT_TRUE(Build(*stub_, upload, response).ok());
  EXPECT_EQ(response.map().builder(), "treelet");
  EXPECT_GT(response.map().options().radius(), 0);  // was sampled
  EXPECT_GT(response.map().statistics().isa_cost(), response.map().statistics().sah_cost());
  EXPECT_EQ(response.map().statistics().kind(), v1::TREE_KIND_KD_TREE);
  const auto log = LogOf("BuildPhotonMap");
  EXPECT_EQ(log["options"]["builder"], "BUILDER_KIND_TREELET");
  EXPECT_EQ(log["options"]["heuristic"], "HEURISTIC_ISA");
  EXPECT_EQ(log["options"]["max_leaf_size"], 8);
  EXPECT_EQ(log["options"]["treelet_size"], 7);
  EXPECT_EQ(log["options"]["rounds"], 1);
  EXPECT_EQ(log["tree"]["leaf_count"], response.map().statistics().leaf_count());
  EXPECT_EQ(log["tree"]["isa_cost"], response.map().statistics().isa_cost());
  EXPECT_TRUE(log["stages_us"].contains("tree"));
}

TEST_F(ServiceLogTest, ARefusedBuildIsLoggedWithWhatItAskedFor) {
  StartGated();
  auto upload = MakeUpload("refused", MakePhotons(10, 1));
  v1::BuildOptions& options = *upload[0].mutable_header()->mutable_options();
  options.set_builder(v1::BUILDER_KIND_HYBRID);
  options.set_subtree_size(5000);
  v1::BuildPhotonMapResponse response;
  const grpc::Status status = Build(*stub_, upload, response);
  EXPECT_EQ(status.error_message(),
            "options.subtree_size is 5000, it must be in [16, 4096], or 0 for the default");
  const auto log = LogOf("BuildPhotonMap");
  EXPECT_EQ(log["options"]["subtree_size"], 5000);
  EXPECT_FALSE(log.contains("tree"));
}

}  // namespace
}  // namespace treelight::testing
