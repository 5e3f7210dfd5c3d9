#include <fstream>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/replicas_fixture.h"
#include "tests/waiting_requests.h"

// What a server reads of the files of others: each map once, and damaged ones are set aside.
namespace treelight::testing {
namespace {

using ::testing::HasSubstr;

using ServiceSharedFilesTest = ReplicatedTest;

TEST_F(ServiceSharedFilesTest, AMapIsLoadedOnceForManyCallsAtOnce) {
  Start();
  const auto gate = std::make_shared<Gate>();
  auto& other = Replica(std::make_unique<GatedBuilder>(gate));
  options_.queue_depth = 200;
  options_.metrics_listen = "127.0.0.1:0";
  auto& deep = Replica(std::make_unique<GatedBuilder>(gate));
  const Photons photons = MakePhotons(1000, 1);
  BuildAt(*stub_, "cloud", photons);
  EXPECT_EQ(CheckAnswer(other, "cloud", photons), 1u);
  EXPECT_EQ(gate->builds, 1);
  gate->open = false;
  std::vector<std::future<std::uint64_t>> calls;
  for (int i = 0; i < 100; ++i) {
    calls.push_back(
        std::async(std::launch::async, [&] { return CheckAnswer(deep, "cloud", photons); }));
  }
  EXPECT_TRUE(Eventually([&] { return gate->builds == 2; }));
  EXPECT_TRUE(Eventually([&] { return WaitingRequests(*replicas_.back().first) == 99; }));
  gate->open = true;
  for (auto& call : calls) EXPECT_EQ(call.get(), 1u);
  EXPECT_EQ(gate->builds, 2);
}

TEST_F(ServiceSharedFilesTest, ACancelledLoadIsLoadedByTheNextThatWaits) {
  Start();
  const auto gate = std::make_shared<Gate>();
  options_.metrics_listen = "127.0.0.1:0";
  auto& other = Replica(std::make_unique<GatedBuilder>(gate));
  const Photons photons = MakePhotons(1000, 1);
  BuildAt(*stub_, "cloud", photons);
  gate->open = false;
  grpc::ClientContext first;
  v1::GatherResponse response;
  auto cancelled = std::async(std::launch::async, [&] {
    return other.Gather(&first, MakeBatch("cloud", kPosition, {.k = 5}), &response).error_code();
  });
  EXPECT_TRUE(Eventually([&] { return gate->builds == 1; }));
  auto waits = std::async(std::launch::async, [&] { return CheckAnswer(other, "cloud", photons); });
  EXPECT_TRUE(Eventually([&] { return WaitingRequests(*replicas_.back().first) == 1; }));
  first.TryCancel();
  EXPECT_EQ(cancelled.get(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(Eventually([&] { return gate->builds == 2; }));
  gate->open = true;
  EXPECT_EQ(waits.get(), 1u);
}

TEST_F(ServiceSharedFilesTest, AFileOfAnotherServerThatIsDamagedIsSetAside) {
  Start();
  auto& other = Replica();
  BuildAt(*stub_, "cloud", MakePhotons(99, 1));
  BuildAt(*stub_, "sound", MakePhotons(99, 2));
  const auto spoil = [&](const std::string& file, std::streamoff at, std::ios::seekdir from) {
    std::fstream bytes(options_.data_folder + "/" + file,
                       std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(at, from);
    bytes.put('x');
  };
  ::testing::internal::CaptureStderr();
  spoil("cloud@1.tlmap", -10, std::ios::end);  // its photons: found when they are read
  v1::GatherResponse response;
  EXPECT_EQ(GatherAt(other, "cloud", response).error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(GatherAt(other, "cloud", response).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(GatherAt(*stub_, "cloud", response).error_code(), grpc::StatusCode::NOT_FOUND);
  BuildAt(*stub_, "cloud", MakePhotons(99, 1));
  spoil("cloud@2.tlmap", 40, std::ios::beg);  // its head: found when it is listed
  EXPECT_EQ(ListAt(other), (std::vector<std::string>{"sound@1"}));
  const std::string told = ::testing::internal::GetCapturedStderr();
  EXPECT_THAT(told, HasSubstr("'cloud@1.tlmap' is damaged: block 2"));
  EXPECT_THAT(told, HasSubstr("'cloud@2.tlmap' is damaged: the checksum of its head"));
  EXPECT_THAT(told, HasSubstr("set aside as 'cloud@2.tlmap.damaged'"));
  CheckAnswer(other, "sound", MakePhotons(99, 2));
}

}  // namespace
}  // namespace treelight::testing
