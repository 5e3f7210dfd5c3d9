#include <future>
#include <thread>
#include <vector>

#include "tests/gated_service.h"

// Maps as they come and go: repeated request ids, times to live, deletion under a gather.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

using ServiceLifetimeTest = GatedServiceTest;

TEST_F(ServiceLifetimeTest, ARepeatedRequestIdAnswersWithTheFirstMap) {
  StartGated();
  auto messages = MakeUpload("once", photons_);
  messages[0].mutable_header()->set_request_id("try-1");
  v1::BuildPhotonMapResponse first, second;
  ASSERT_TRUE(Build(*stub_, messages, first).ok());
  messages[0].mutable_header()->set_name("another");
  const auto status = Build(*stub_, messages, second);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(second.map().SerializeAsString(), first.map().SerializeAsString());
  EXPECT_EQ(gate_->builds, 2);  // of "cloud" and "once"
}

TEST_F(ServiceLifetimeTest, TwoBuildsAtOnceWithOneRequestIdMakeOneMap) {
  StartGated();
  gate_->open = false;
  auto messages = MakeUpload("once", photons_);
  messages[0].mutable_header()->set_request_id("try-1");
  v1::BuildPhotonMapResponse responses[2];
  std::vector<std::future<grpc::Status>> calls;
  for (auto& response : responses) {
    calls.push_back(
        std::async(std::launch::async, [&] { return Build(*stub_, messages, response); }));
  }
  ASSERT_TRUE(Eventually([&] { return gate_->builds == 2; }));
  std::this_thread::sleep_for(50ms);  // the second waits for the device meanwhile
  gate_->open = true;
  for (auto& call : calls) EXPECT_TRUE(call.get().ok());
  EXPECT_EQ(responses[0].map().SerializeAsString(), responses[1].map().SerializeAsString());
  EXPECT_EQ(gate_->builds, 2);
}

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
