#include <string>
#include <vector>

#include "tests/gated_service.h"
#include "tests/temporary_folder.h"

// BUILDER_KIND_AUTO: the server chooses the tree, and says why.
namespace treelight::testing {
namespace {

class ServiceAutoTest : public GatedServiceTest {
 protected:
  v1::BuildOptions Auto() const {
    v1::BuildOptions options;
    options.set_builder(v1::BUILDER_KIND_AUTO);
    return options;
  }

  grpc::Status Rebuild(const v1::BuildOptions& options) {
    v1::RebuildPhotonMapRequest request;
    request.set_name("cloud");
    *request.mutable_options() = options;
    grpc::ClientContext context;
    return stub_->RebuildPhotonMap(&context, request, &response_);
  }

  /// Uploads the photons for a map "cloud" with `options`.
  grpc::Status Upload(const v1::BuildOptions& options) {
    auto upload = MakeUpload("cloud", photons_);
    *upload[0].mutable_header()->mutable_options() = options;
    return Build(*stub_, upload, response_);
  }

  v1::BuildPhotonMapResponse response_;
};

TEST_F(ServiceAutoTest, ATreeIsChosenAndTheAnswersAreTheSame) {
  Start(MakeCpuBuilder());
  ASSERT_TRUE(Upload(Auto()).ok());
  const v1::PhotonMap& map = response_.map();
  const v1::BuildOptions& options = map.options();
  EXPECT_TRUE(options.builder() == v1::BUILDER_KIND_LBVH ||
              options.builder() == v1::BUILDER_KIND_HYBRID);
  EXPECT_EQ(map.builder(), options.builder() == v1::BUILDER_KIND_LBVH ? "lbvh" : "hybrid");
  EXPECT_TRUE(options.morton_bits() == 30 || options.morton_bits() == 63);
  EXPECT_GE(options.max_leaf_size(), 16u);
  EXPECT_EQ(options.expected_gathers(), 0u);  // what it was chosen for is in the reason
  EXPECT_NE(map.choice().find("for 1e+03 gathers of k 50"), std::string::npos) << map.choice();

  const auto points = MakePoints(100, 3);
  const GatherOptions gather{.k = 20, .outputs = kOutputCount | kOutputNeighbors};
  grpc::ClientContext context;
  v1::GatherResponse answer;
  ASSERT_TRUE(stub_->Gather(&context, MakeBatch("cloud", points, gather), &answer).ok());
  const GatherResult expected = Expected(photons_, points, gather);
  EXPECT_EQ(Array<std::uint32_t>(answer.counts()), expected.counts);
  EXPECT_EQ(Array<std::uint32_t>(answer.neighbor_ids()), expected.neighbor_ids);

  const auto log = LogOf("BuildPhotonMap");
  EXPECT_EQ(log["choice"], map.choice());
  EXPECT_GT(log["stages_us"]["choose"], 0);
}

TEST_F(ServiceAutoTest, WhatIsSaidIsNotChosen) {
  Start(MakeCpuBuilder());
  MustBuild("cloud", photons_);
  v1::BuildOptions options = Auto();
  options.set_max_leaf_size(9);
  options.set_morton_bits(63);
  options.set_expected_gathers(1);
  options.set_expected_k(0);
  ASSERT_TRUE(Rebuild(options).ok());
  EXPECT_EQ(response_.map().options().builder(), v1::BUILDER_KIND_LBVH);  // hardly any gathers
  EXPECT_EQ(response_.map().options().max_leaf_size(), 9u);
  EXPECT_EQ(response_.map().options().morton_bits(), 63u);
  EXPECT_NE(response_.map().choice().find("1 gathers of a radius"), std::string::npos)
      << response_.map().choice();
  // Built as if that had been asked for.
  const v1::PhotonMap chosen = response_.map();
  ASSERT_TRUE(Rebuild(chosen.options()).ok());
  EXPECT_EQ(response_.map().statistics().node_count(), chosen.statistics().node_count());
  EXPECT_EQ(response_.map().choice(), "");
}

TEST_F(ServiceAutoTest, WrongValuesAreNamed) {
  Start(MakeCpuBuilder());
  MustBuild("cloud", photons_);
  v1::BuildOptions options = Auto();
  options.set_expected_k(4097);
  grpc::Status status = Rebuild(options);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(),
            "options.expected_k is 4097, it must be in [0, 4096], 0 for gathers within a radius");
  options = Auto();
  options.set_max_leaf_size(65);
  status = Upload(options);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(status.error_message().find("max_leaf_size is 65"), std::string::npos);
  options = Auto();
  options.set_morton_bits(31);
  EXPECT_EQ(Rebuild(options).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(ServiceAutoTest, ARestartBuildsTheTreeThatWasChosen) {
  const TemporaryFolder folder;
  options_.data_folder = folder.path();
  Start(MakeCpuBuilder());
  ASSERT_TRUE(Upload(Auto()).ok());
  const v1::PhotonMap before = response_.map();
  Start(MakeCpuBuilder());
  grpc::ClientContext context;
  v1::GatherResponse answer;
  ASSERT_TRUE(Gather(context, answer).ok());
  grpc::ClientContext again;
  v1::GetPhotonMapRequest request;
  request.set_name("cloud");
  v1::PhotonMap after;
  ASSERT_TRUE(stub_->GetPhotonMap(&again, request, &after).ok());
  EXPECT_EQ(after.options().SerializeAsString(), before.options().SerializeAsString());
  EXPECT_EQ(after.statistics().node_count(), before.statistics().node_count());
}

}  // namespace
}  // namespace treelight::testing
