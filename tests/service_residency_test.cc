#include <algorithm>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/http_get.h"
#include "tests/server_fixture.h"
#include "tests/sized_builder.h"
#include "tests/temporary_folder.h"

// Maps without a data folder: out of the device, into the host's memory, and back.
namespace treelight::testing {
namespace {

using ::testing::HasSubstr;

class ServiceResidencyTest : public ServerTest {
 protected:
  static constexpr std::size_t kCount = 100'000;
  static constexpr std::uint64_t kMapBytes = 64 * kCount;  // of a SizedBuilder
  static constexpr std::uint64_t kRest = 3'000'000;        // too little for another map

  /// A server on a device of `type` that has room for `bytes`.
  void StartOn(const std::string& type, std::uint64_t bytes) {
    DeviceInfo device;
    device.type = type;
    device.memory_bytes = device.max_buffer_bytes = bytes;
    options_.devices = {device};
    Start(std::make_unique<SizedBuilder>());
  }
  std::vector<v1::PhotonMap> Maps() {
    grpc::ClientContext context;
    v1::ListPhotonMapsResponse response;
    EXPECT_TRUE(stub_->ListPhotonMaps(&context, {}, &response).ok());
    return {response.maps().begin(), response.maps().end()};
  }
  std::vector<std::string> Resident() {
    std::vector<std::string> names;
    for (const v1::PhotonMap& map : Maps()) {
      if (map.device_bytes() > 0) names.push_back(map.name());
    }
    return names;
  }
  std::uint64_t DeviceBytesUsed() {
    grpc::ClientContext context;
    v1::ServerInfo info;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info.device_bytes_used();
  }
  grpc::Status GatherAll(const std::string& name, v1::GatherResponse& response) {
    grpc::ClientContext context;
    return stub_->Gather(&context, MakeBatch(name, queries_, {.k = 5, .outputs = 31}), &response);
  }
  /// Waits until the metrics have `line`; with ServerOptions::metrics_listen, as what waits by it.
  void WaitFor(const std::string& line) {
    EXPECT_TRUE(Eventually([&] {
      return HttpGet(server_->metrics_port(), "/metrics").find(line + "\n") != std::string::npos;
    })) << line;
  }
  /// Gathers, with statistics, which tell one tree from another, and waits until the call has let
  /// go of its map, a moment after the answer.
  std::string Answer(const std::string& name) {
    v1::GatherResponse response;
    const auto status = GatherAll(name, response);
    EXPECT_TRUE(status.ok()) << name << ": " << status.error_message();
    WaitFor("treelight_open_calls 0");
    response.clear_timings();
    return response.SerializeAsString();
  }

  /// Builds, and waits until what the upload has taken is given back, a moment after the answer.
  void BuildAndWait(const std::string& name, const Photons& photons) {
    MustBuild(name, photons);
    WaitFor("treelight_memory_held_bytes{holder=\"uploads\"} 0");
  }

  const std::vector<float> queries_ = MakePoints(20, 9);
};

TEST_F(ServiceResidencyTest, IdleMapsLeaveTheDeviceForHostMemoryAndComeBack) {
  options_.metrics_listen = "127.0.0.1:0";
  StartOn("gpu", 2 * kMapBytes + kRest);
  std::vector<std::string> answers;
  for (std::uint32_t i = 0; i < 5; ++i) {
    const std::string name = "map" + std::to_string(i);
    MustBuild(name, MakePhotons(kCount, i));
    answers.push_back(Answer(name));
  }
  EXPECT_THAT(Resident(), ::testing::Contains("map4"));
  EXPECT_LE(Resident().size(), 2u);
  for (const std::size_t i : {0, 3, 1, 4, 0, 2}) {
    const std::string name = "map" + std::to_string(i);
    EXPECT_EQ(Answer(name), answers[i]) << name;
    EXPECT_THAT(Resident(), ::testing::Contains(name));
    EXPECT_LE(DeviceBytesUsed(), options_.devices[0].memory_bytes);
  }
}

TEST_F(ServiceResidencyTest, MapsThatLeaveArePaidForWithHostMemoryAndStayWithoutIt) {
  // Room for the photons of one map, 28 B each, beside an upload: its own, and two messages.
  constexpr std::uint64_t kPhotonBytes = 28 * kCount;
  options_.metrics_listen = "127.0.0.1:0";
  options_.memory_limit =
      2 * options_.limits.max_message_bytes + 2 * kPhotonBytes + kPhotonBytes / 2;
  StartOn("gpu", kMapBytes + kRest);
  BuildAndWait("map0", MakePhotons(kCount, 0));
  BuildAndWait("map1", MakePhotons(kCount, 1));
  EXPECT_EQ(Resident(), (std::vector<std::string>{"map1"}));
  v1::BuildPhotonMapResponse response;
  const auto status = Build(*stub_, MakeUpload("map2", MakePhotons(kCount, 2)), response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("of which maps hold 6400000; delete maps"));
  EXPECT_EQ(Resident(), (std::vector<std::string>{"map1"}));
  Answer("map1");
  Answer("map0");
  EXPECT_EQ(Resident(), (std::vector<std::string>{"map0"}));  // they have changed places
}

TEST_F(ServiceResidencyTest, OfAMapOfTheCpuOnlyThePhotonsStay) {
  options_.metrics_listen = "127.0.0.1:0";
  options_.memory_limit = 44 << 20;  // of which a message is kept for a request
  StartOn("cpu", std::uint64_t{1} << 40);
  std::vector<std::string> answers;
  constexpr std::uint32_t kMaps = 8;  // which would hold 51 MB
  for (std::uint32_t i = 0; i < kMaps; ++i) {
    const std::string name = "map" + std::to_string(i);
    BuildAndWait(name, MakePhotons(kCount, i));
    answers.push_back(Answer(name));
  }
  EXPECT_LT(Resident().size(), kMaps);
  for (std::uint32_t i = 0; i < kMaps; ++i) {
    EXPECT_EQ(Answer("map" + std::to_string(i)), answers[i]) << i;
  }
}

TEST_F(ServiceResidencyTest, NoneLeavesForAMapThatNeverFits) {
  StartOn("gpu", 2 * kMapBytes);
  MustBuild("map", MakePhotons(kCount, 1));
  v1::BuildPhotonMapResponse response;
  const auto status = Build(*stub_, MakeUpload("large", MakePhotons(10 * kCount, 1)), response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(Resident(), (std::vector<std::string>{"map"}));
}

TEST_F(ServiceResidencyTest, NoneLeavesWhereAllThatCanHoldTooLittle) {
  options_.memory_limit = 64 << 20;
  StartOn("cpu", std::uint64_t{1} << 40);
  MustBuild("map", MakePhotons(kCount, 1));
  // An upload holds what is missing, and stays.
  const auto held = MakeUpload("held", MakePhotons(4 * kCount, 1));
  grpc::ClientContext context;
  v1::BuildPhotonMapResponse answer;
  const auto writer = stub_->BuildPhotonMap(&context, &answer);
  ASSERT_TRUE(writer->Write(held[0]) && writer->Write(held[1]));
  ASSERT_TRUE(Eventually([&] {
    grpc::ClientContext asking;
    v1::ServerInfo info;
    return stub_->GetServerInfo(&asking, {}, &info).ok() &&
           info.memory_bytes_used() > 4 * kMapBytes;
  }));
  v1::BuildPhotonMapResponse response;
  const auto status = Build(*stub_, MakeUpload("more", MakePhotons(4 * kCount, 2)), response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(Resident(), (std::vector<std::string>{"map"}));
  context.TryCancel();
  writer->Finish();
}

TEST_F(ServiceResidencyTest, IdleMapsOfACpuLeaveForGathersToo) {
  const TemporaryFolder folder;
  options_.data_folder = folder.path();
  options_.metrics_listen = "127.0.0.1:0";
  options_.memory_limit = 44 << 20;
  StartOn("cpu", std::uint64_t{1} << 40);
  // The last one leaves as much free as an upload holds beside the map, and a map more at most.
  for (std::uint32_t i = 0; i < 6; ++i) {
    BuildAndWait("map" + std::to_string(i), MakePhotons(kCount, i));
  }
  const std::size_t resident = Resident().size();
  // Each stream has room for a message as long as it is open.
  struct Open {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReaderWriter<v1::GatherRequest, v1::GatherResponse>> stream;
  };
  std::vector<std::unique_ptr<Open>> streams;
  for (int i = 0; i < 5; ++i) {
    auto& open = *streams.emplace_back(std::make_unique<Open>());
    open.stream = stub_->GatherStream(&open.context);
    ASSERT_TRUE(open.stream->Write(MakeBatch("map5", queries_, {.k = 5, .outputs = 31})));
    v1::GatherResponse response;
    ASSERT_TRUE(open.stream->Read(&response)) << open.stream->Finish().error_message();
  }
  EXPECT_LT(Resident().size(), resident);
  for (const auto& open : streams) {
    open->stream->WritesDone();
    EXPECT_TRUE(open->stream->Finish().ok());
  }
}

TEST_F(ServiceResidencyTest, AMapThatIsAwayIsRebuiltFromAndDeleted) {
  options_.metrics_listen = "127.0.0.1:0";
  StartOn("gpu", kMapBytes + kRest);
  const Photons photons = MakePhotons(kCount, 1);
  MustBuild("away", photons);
  const std::string answer = Answer("away");
  MustBuild("here", MakePhotons(kCount, 2));
  ASSERT_EQ(Resident(), (std::vector<std::string>{"here"}));
  MustRebuild("away", "again");
  EXPECT_EQ(Resident(), (std::vector<std::string>{"again"}));  // its source stays away
  grpc::ClientContext deleting;
  v1::DeletePhotonMapRequest gone;
  gone.set_name("away");
  v1::DeletePhotonMapResponse deleted;
  EXPECT_TRUE(stub_->DeletePhotonMap(&deleting, gone, &deleted).ok());
  EXPECT_EQ(Maps().size(), 2u);
}

}  // namespace
}  // namespace treelight::testing
