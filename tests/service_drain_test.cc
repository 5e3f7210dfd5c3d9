#include <future>

#include "tests/gated_service.h"

// A server that is told to stop while calls are open.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

using ServiceDrainTest = GatedServiceTest;

TEST_F(ServiceDrainTest, ADrainLetsOpenCallsFinishAndRefusesNewOnes) {
  StartGated();
  const auto running = GatherAtGate();
  auto drained = std::async([&] { return server_->Drain(std::chrono::system_clock::now() + 10s); });
  // Calls are refused from some moment on; until then they wait in the queue behind the gate.
  ASSERT_TRUE(Eventually([&] {
    grpc::ClientContext probe;
    v1::ServerInfo info;
    return stub_->GetServerInfo(&probe, {}, &info).error_code() == grpc::StatusCode::UNAVAILABLE;
  }));
  grpc::ClientContext late;
  v1::GatherResponse response;
  EXPECT_EQ(Gather(late, response).error_message(),
            "the server is stopping and takes no new calls");
  gate_->open = true;
  EXPECT_TRUE(running->status.get().ok());
  EXPECT_EQ(drained.get(), 0u);
}

TEST_F(ServiceDrainTest, ADrainCancelsWhatIsOpenAtItsEnd) {
  StartGated();
  const auto running = GatherAtGate();
  EXPECT_EQ(server_->Drain(std::chrono::system_clock::now() + 20ms), 1u);
  EXPECT_FALSE(running->status.get().ok());
}

TEST_F(ServiceDrainTest, ACallRefusedInADrainIsLogged) {
  DeviceInfo device;
  device.name = "drained";
  device.memory_bytes = device.max_buffer_bytes = 1 << 30;
  options_.devices = {device};
  StartGated();
  // An upload that stands still keeps the drain from its end.
  grpc::ClientContext open, late, late_stream;
  v1::BuildPhotonMapResponse built;
  const auto upload = stub_->BuildPhotonMap(&open, &built);
  ASSERT_TRUE(upload->Write(MakeUpload("standing", photons_)[0]));
  v1::ServerInfo info;
  grpc::ClientContext first;
  ASSERT_TRUE(stub_->GetServerInfo(&first, {}, &info).ok());  // the upload was taken up before
  auto drained = std::async([&] { return server_->Drain(std::chrono::system_clock::now() + 10s); });
  ASSERT_TRUE(Eventually([&] {
    grpc::ClientContext probe;
    return stub_->GetServerInfo(&probe, {}, &info).error_code() == grpc::StatusCode::UNAVAILABLE;
  }));
  v1::GatherResponse response;
  EXPECT_EQ(Gather(late, response).error_code(), grpc::StatusCode::UNAVAILABLE);
  const auto stream = stub_->GatherStream(&late_stream);
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  open.TryCancel();
  EXPECT_FALSE(upload->Finish().ok());
  drained.get();

  const auto lines = LogByMethod();
  for (const char* method : {"GetServerInfo", "Gather", "GatherStream"}) {
    ASSERT_TRUE(lines.contains(method)) << method;
    EXPECT_EQ(lines.at(method)["code"], "UNAVAILABLE") << method;
    EXPECT_NE(lines.at(method)["peer"], "") << method;
  }
  EXPECT_EQ(lines.at("Gather")["map"], "cloud");
  EXPECT_EQ(lines.at("Gather")["queries"], 1);
  EXPECT_EQ(lines.at("Gather")["k"], 1);
  EXPECT_EQ(lines.at("Gather")["r"], "inf");
  for (const char* method : {"BuildPhotonMap", "Gather", "GatherStream"}) {
    EXPECT_EQ(lines.at(method)["device"], "drained") << method;
  }
}

}  // namespace
}  // namespace treelight::testing
