#include <vector>

#include "tests/gated_service.h"

// Maps as they go: times to live, deletion under a gather.
namespace treelight::testing {
namespace {

using ServiceLifetimeTest = GatedServiceTest;

TEST_F(ServiceLifetimeTest, AMapWithATimeToLiveGoes) {
  StartGated();
  auto messages = MakeUpload("brief", photons_);
  messages[0].mutable_header()->set_time_to_live_ms(100);
  v1::BuildPhotonMapResponse built;
  ASSERT_TRUE(Build(*stub_, messages, built).ok());
  EXPECT_EQ(built.map().expires_unix_ms() - built.map().created_unix_ms(), 100);
  const auto code = [&] {
    v1::GetPhotonMapRequest request;
    request.set_name("brief");
    v1::PhotonMap map;
    grpc::ClientContext context;
    return stub_->GetPhotonMap(&context, request, &map).error_code();
  };
  EXPECT_TRUE(Eventually([&] { return code() == grpc::StatusCode::NOT_FOUND; }));
}

TEST_F(ServiceLifetimeTest, AGatherOnADeletedMapFinishes) {
  StartGated();
  const auto running = GatherAtGate();
  Delete("cloud");
  gate_->open = true;
  EXPECT_TRUE(running->status.get().ok());
  EXPECT_EQ(Array<std::uint32_t>(running->response.counts()), std::vector<std::uint32_t>{1});
}

}  // namespace
}  // namespace treelight::testing
