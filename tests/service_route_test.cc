#include <memory>
#include <string>
#include <vector>

#include "tests/replicas_fixture.h"

// Calls that a balancer has sent here by the metadata x-treelight-map.
namespace treelight::testing {
namespace {

using ServiceRouteTest = ReplicatedTest;

TEST_F(ServiceRouteTest, AMapTheMetadataDoesNotNameIsRefused) {
  Start();
  const Photons photons = MakePhotons(100, 1);
  BuildAt(*stub_, "cloud", photons);
  const auto with = [](const char* key) {
    auto context = std::make_unique<grpc::ClientContext>();
    context->AddMetadata("x-treelight-map", key);
    return context;
  };
  v1::GatherResponse answer;
  const auto batch = MakeBatch("cloud", kPosition, {.k = 5});
  EXPECT_TRUE(stub_->Gather(with("cloud").get(), batch, &answer).ok());
  const auto refused = stub_->Gather(with("rain").get(), batch, &answer);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(refused.error_message(),
            "metadata x-treelight-map is 'rain', the map of the request 'cloud': calls of one map "
            "must go to one server; send the name of the map, or no such metadata");
  EXPECT_EQ(stub_->Gather(with("").get(), batch, &answer).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  {
    // Each batch of a stream.
    const auto context = with("cloud");
    const auto stream = stub_->GatherStream(context.get());
    EXPECT_TRUE(stream->Write(batch));
    EXPECT_TRUE(stream->Read(&answer));
    stream->Write(MakeBatch("rain", kPosition, {.k = 5}));
    EXPECT_FALSE(stream->Read(&answer));
    EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  }
  v1::GetPhotonMapRequest get;
  v1::PhotonMap map;
  get.set_name("cloud");
  EXPECT_TRUE(stub_->GetPhotonMap(with("cloud").get(), get, &map).ok());
  EXPECT_EQ(stub_->GetPhotonMap(with("rain").get(), get, &map).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  {
    const auto context = with("rain");
    v1::BuildPhotonMapResponse built;
    const auto upload = stub_->BuildPhotonMap(context.get(), &built);
    for (const auto& message : MakeUpload("cloud", photons)) {
      if (!upload->Write(message)) break;
    }
    upload->WritesDone();
    EXPECT_EQ(upload->Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  }
  // A rebuild belongs to the map that it builds.
  v1::RebuildPhotonMapRequest rebuild;
  v1::BuildPhotonMapResponse rebuilt;
  rebuild.set_name("cloud");
  rebuild.set_new_name("again");
  EXPECT_EQ(stub_->RebuildPhotonMap(with("cloud").get(), rebuild, &rebuilt).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_TRUE(stub_->RebuildPhotonMap(with("again").get(), rebuild, &rebuilt).ok());
  v1::DeletePhotonMapRequest remove;
  v1::DeletePhotonMapResponse removed;
  remove.set_name("cloud");
  EXPECT_EQ(stub_->DeletePhotonMap(with("rain").get(), remove, &removed).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_TRUE(stub_->DeletePhotonMap(with("cloud").get(), remove, &removed).ok());
  EXPECT_EQ(ListAt(*stub_), (std::vector<std::string>{"again@1"}));
}

}  // namespace
}  // namespace treelight::testing
