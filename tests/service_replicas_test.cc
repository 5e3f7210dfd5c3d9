#include <fcntl.h>
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <future>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"
#include "tests/temporary_folder.h"

// Several servers on one data folder: each answers for what the others build and delete.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;
using ::testing::HasSubstr;

/// Longer than the time of a folder may stand still: from here on a look at it is a stat.
constexpr auto kSettled = 120ms;

class ServiceReplicasTest : public ServerTest {
 protected:
  ServiceReplicasTest() { options_.data_folder = folder_ + "/maps"; }
  ~ServiceReplicasTest() override { replicas_.clear(); }

  /// Another server on the folder.
  v1::PhotonMapService::Stub& Replica(std::unique_ptr<Builder> builder = MakeBruteForceBuilder()) {
    auto server = server::Server::Start(options_, std::move(builder));
    EXPECT_TRUE(server.ok()) << server.status();
    auto stub = v1::PhotonMapService::NewStub((*server)->InProcessChannel());
    return *replicas_.emplace_back(*std::move(server), std::move(stub)).second;
  }

  static v1::PhotonMap BuildAt(v1::PhotonMapService::Stub& stub, const std::string& name,
                               const Photons& photons, const std::string& request_id = {},
                               std::uint64_t ttl_ms = 0) {
    auto messages = MakeUpload(name, photons);
    messages[0].mutable_header()->set_request_id(request_id);
    messages[0].mutable_header()->set_time_to_live_ms(ttl_ms);
    v1::BuildPhotonMapResponse response;
    const auto status = Build(stub, messages, response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.map();
  }
  static grpc::Status GatherAt(v1::PhotonMapService::Stub& stub, const std::string& name,
                               v1::GatherResponse& response, std::uint64_t version = 0) {
    grpc::ClientContext context;
    auto batch = MakeBatch(name, kPosition, {.k = 5, .outputs = kOutputNeighbors});
    batch.set_version(version);
    return stub.Gather(&context, batch, &response);
  }
  /// Gathers in `name` and compares with brute force over `photons`; the version that answered.
  static std::uint64_t CheckAnswer(v1::PhotonMapService::Stub& stub, const std::string& name,
                                   const Photons& photons) {
    v1::GatherResponse response;
    const auto status = GatherAt(stub, name, response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    const auto expected = Expected(photons, kPosition, {.k = 5, .outputs = kOutputNeighbors});
    EXPECT_EQ(Array<std::uint32_t>(response.neighbor_ids()), expected.neighbor_ids);
    return response.version();
  }
  static grpc::StatusCode DeleteAt(v1::PhotonMapService::Stub& stub, const std::string& name,
                                   std::uint64_t version = 0) {
    grpc::ClientContext context;
    v1::DeletePhotonMapRequest request;
    request.set_name(name);
    request.set_version(version);
    v1::DeletePhotonMapResponse response;
    return stub.DeletePhotonMap(&context, request, &response).error_code();
  }
  /// name@version of all maps, and how many of them GetServerInfo tells.
  static std::vector<std::string> ListAt(v1::PhotonMapService::Stub& stub) {
    grpc::ClientContext context, info_context;
    v1::ListPhotonMapsResponse response;
    EXPECT_TRUE(stub.ListPhotonMaps(&context, {}, &response).ok());
    std::vector<std::string> names;
    for (const auto& map : response.maps()) {
      names.push_back(map.name() + "@" + std::to_string(map.version()));
    }
    v1::ServerInfo info;
    EXPECT_TRUE(stub.GetServerInfo(&info_context, {}, &info).ok());
    EXPECT_EQ(info.map_count(), names.size());
    return names;
  }

  static inline const std::vector<float> kPosition = {0.5f, 0.5f, 0.5f};
  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
  std::vector<
      std::pair<std::unique_ptr<server::Server>, std::unique_ptr<v1::PhotonMapService::Stub>>>
      replicas_;
};

TEST_F(ServiceReplicasTest, WhatOneBuildsAllAnswerAndList) {
  Start();
  auto& other = Replica();
  auto& third = Replica();
  const Photons first = MakePhotons(500, 1), second = MakePhotons(700, 2);
  BuildAt(*stub_, "cloud", first);
  EXPECT_EQ(CheckAnswer(other, "cloud", first), 1u);
  BuildAt(other, "rain", second);
  for (auto* stub : {stub_.get(), &other, &third}) {
    EXPECT_EQ(ListAt(*stub), (std::vector<std::string>{"cloud@1", "rain@1"}));
    EXPECT_EQ(CheckAnswer(*stub, "cloud", first), 1u);
    EXPECT_EQ(CheckAnswer(*stub, "rain", second), 1u);
  }
  grpc::ClientContext here, there;
  v1::GetPhotonMapRequest request;
  request.set_name("cloud");
  v1::PhotonMap told, told_there;
  ASSERT_TRUE(stub_->GetPhotonMap(&here, request, &told).ok());
  ASSERT_TRUE(other.GetPhotonMap(&there, request, &told_there).ok());
  told.clear_device(), told_there.clear_device();  // each tells of its own
  EXPECT_EQ(told_there.DebugString(), told.DebugString());
}

TEST_F(ServiceReplicasTest, TheNewestIsTheNewestOfAll) {
  Start();
  auto& other = Replica();
  for (std::uint32_t version = 1; version <= 20; ++version) {
    // Now at one, now at the other, at once and after a while: each answers by the other's last.
    const Photons photons = MakePhotons(100 + version, version);
    auto& builds = version % 2 == 0 ? other : *stub_;
    auto& answers = version % 2 == 0 ? *stub_ : other;
    if (version % 5 == 0) std::this_thread::sleep_for(kSettled);
    EXPECT_EQ(BuildAt(builds, "cloud", photons).version(), version);
    EXPECT_EQ(CheckAnswer(answers, "cloud", photons), version);
    EXPECT_EQ(CheckAnswer(builds, "cloud", photons), version);
  }
}

TEST_F(ServiceReplicasTest, AChangeThatTheFoldersTimeDoesNotTellIsSeen) {
  Start();
  auto& other = Replica();
  // A file system that tells whole seconds: the folder's time stands still over both builds.
  const auto stand_still = [&, second = std::chrono::system_clock::now()] {
    const timespec time{.tv_sec = std::chrono::system_clock::to_time_t(second), .tv_nsec = 0};
    const timespec times[] = {time, time};
    ASSERT_EQ(utimensat(AT_FDCWD, options_.data_folder.c_str(), times, 0), 0);
  };
  for (std::uint32_t version = 1; version <= 3; ++version) {
    const Photons photons = MakePhotons(100 + version, version);
    BuildAt(*stub_, "cloud", photons);
    stand_still();
    EXPECT_EQ(CheckAnswer(other, "cloud", photons), version);
  }
}

TEST_F(ServiceReplicasTest, WhatOneDeletesIsGoneEverywhere) {
  Start();
  auto& other = Replica();
  const Photons photons = MakePhotons(100, 1);
  for (int i = 0; i < 3; ++i) BuildAt(*stub_, "cloud", photons);
  EXPECT_EQ(CheckAnswer(other, "cloud", photons), 3u);
  std::this_thread::sleep_for(kSettled);
  EXPECT_EQ(DeleteAt(*stub_, "cloud", 3), grpc::StatusCode::OK);
  EXPECT_EQ(CheckAnswer(other, "cloud", photons), 2u);
  v1::GatherResponse response;
  EXPECT_EQ(GatherAt(other, "cloud", response, 3).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(DeleteAt(other, "cloud"), grpc::StatusCode::OK);
  EXPECT_EQ(DeleteAt(*stub_, "cloud"), grpc::StatusCode::NOT_FOUND);
  EXPECT_TRUE(ListAt(*stub_).empty());
  EXPECT_TRUE(std::filesystem::is_empty(options_.data_folder));
}

TEST_F(ServiceReplicasTest, AVersionThatCameBackWithOtherPhotonsIsNotTakenForTheOld) {
  Start();
  auto& other = Replica();
  BuildAt(*stub_, "cloud", MakePhotons(100, 1));
  CheckAnswer(other, "cloud", MakePhotons(100, 1));
  // One that never knew of the version gives it anew.
  ASSERT_EQ(DeleteAt(*stub_, "cloud"), grpc::StatusCode::OK);
  const Photons photons = MakePhotons(100, 2);
  ASSERT_EQ(BuildAt(Replica(), "cloud", photons).version(), 1u);
  EXPECT_EQ(CheckAnswer(other, "cloud", photons), 1u);
  EXPECT_EQ(CheckAnswer(*stub_, "cloud", photons), 1u);
}

TEST_F(ServiceReplicasTest, WhatExpiresAtOneIsGoneEverywhere) {
  Start();
  auto& other = Replica();
  BuildAt(*stub_, "short", MakePhotons(100, 1), "", 300);
  CheckAnswer(other, "short", MakePhotons(100, 1));
  EXPECT_TRUE(Eventually([&] { return std::filesystem::is_empty(options_.data_folder); }));
  EXPECT_TRUE(ListAt(other).empty());
  EXPECT_TRUE(ListAt(*stub_).empty());
}

TEST_F(ServiceReplicasTest, ARepeatedRequestIdAnswersWithTheMapOfAnotherServer) {
  Start();
  auto& other = Replica();
  const auto built = BuildAt(*stub_, "cloud", MakePhotons(100, 1), "one");
  const auto repeated = BuildAt(other, "cloud", MakePhotons(100, 1), "one");
  EXPECT_EQ(repeated.version(), 1u);
  EXPECT_EQ(repeated.created_unix_ms(), built.created_unix_ms());
  EXPECT_EQ(ListAt(*stub_), (std::vector<std::string>{"cloud@1"}));

  v1::RebuildPhotonMapRequest request;
  request.set_name("cloud");
  request.set_new_name("again");
  request.set_request_id("two");
  v1::BuildPhotonMapResponse first, second;
  grpc::ClientContext here, there;
  ASSERT_TRUE(other.RebuildPhotonMap(&here, request, &first).ok());
  ASSERT_TRUE(stub_->RebuildPhotonMap(&there, request, &second).ok());
  EXPECT_EQ(second.map().created_unix_ms(), first.map().created_unix_ms());
  EXPECT_EQ(ListAt(*stub_), (std::vector<std::string>{"again@1", "cloud@1"}));
}

TEST_F(ServiceReplicasTest, BuildsOfOneRequestAtTheSameMomentMakeOneMap) {
  Start();
  std::vector<v1::PhotonMapService::Stub*> stubs = {stub_.get(), &Replica(), &Replica()};
  for (int round = 0; round < 10; ++round) {
    const std::string id = "id" + std::to_string(round);
    std::vector<std::future<v1::PhotonMap>> builds;
    for (auto* stub : stubs) {
      builds.push_back(std::async(std::launch::async, [stub, id] {
        return BuildAt(*stub, "cloud", MakePhotons(200, 1), id);
      }));
    }
    const v1::PhotonMap first = builds[0].get();
    for (auto& build : std::span(builds).subspan(1)) {
      const v1::PhotonMap map = build.get();
      EXPECT_EQ(map.version(), first.version());
      EXPECT_EQ(map.created_unix_ms(), first.created_unix_ms());
    }
  }
  for (auto* stub : stubs) EXPECT_EQ(ListAt(*stub).size(), 10u);
}

TEST_F(ServiceReplicasTest, AMapIsLoadedOnceForManyCallsAtOnce) {
  Start();
  const auto gate = std::make_shared<Gate>();
  auto& other = Replica(std::make_unique<GatedBuilder>(gate));
  options_.queue_depth = 200;
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
  std::this_thread::sleep_for(50ms);  // the others are here
  gate->open = true;
  for (auto& call : calls) EXPECT_EQ(call.get(), 1u);
  EXPECT_EQ(gate->builds, 2);
}

TEST_F(ServiceReplicasTest, ACancelledLoadIsLoadedByTheNextThatWaits) {
  Start();
  const auto gate = std::make_shared<Gate>();
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
  std::this_thread::sleep_for(20ms);
  first.TryCancel();
  EXPECT_EQ(cancelled.get(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(Eventually([&] { return gate->builds == 2; }));
  gate->open = true;
  EXPECT_EQ(waits.get(), 1u);
}

TEST_F(ServiceReplicasTest, AFileOfAnotherServerThatIsDamagedIsSetAside) {
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
  EXPECT_THAT(told, HasSubstr("'cloud@1.tlmap' of the data folder: block 2"));
  EXPECT_THAT(told, HasSubstr("'cloud@2.tlmap' is damaged: the checksum of its head"));
  EXPECT_THAT(told, HasSubstr("set aside as 'cloud@2.tlmap.damaged'"));
  CheckAnswer(other, "sound", MakePhotons(99, 2));
}

TEST_F(ServiceReplicasTest, AFileThatIsPutThereOrRestoredIsServed) {
  Start();
  const Photons photons = MakePhotons(300, 1);
  BuildAt(*stub_, "cloud", photons);
  const std::string file = options_.data_folder + "/cloud@1.tlmap", aside = folder_ + "/backup";
  std::filesystem::copy_file(file, aside);
  std::filesystem::remove(file);
  v1::GatherResponse response;
  EXPECT_EQ(GatherAt(*stub_, "cloud", response).error_code(), grpc::StatusCode::NOT_FOUND);
  std::filesystem::rename(aside, file);
  EXPECT_EQ(CheckAnswer(*stub_, "cloud", photons), 1u);
}

TEST_F(ServiceReplicasTest, ServersThatBuildAndDeleteAtOnceEndUpAlike) {
  Start();
  std::vector<v1::PhotonMapService::Stub*> stubs = {stub_.get(), &Replica(), &Replica()};
  std::vector<std::jthread> threads;
  for (std::uint32_t i = 0; i < 3; ++i) {
    threads.emplace_back([stub = stubs[i], i] {
      for (std::uint32_t round = 0; round < 15; ++round) {
        const auto map = BuildAt(*stub, "cloud", MakePhotons(50, i));
        if (round % 3 == 0) {
          EXPECT_EQ(DeleteAt(*stub, "cloud", map.version()), grpc::StatusCode::OK);
        } else {
          v1::GatherResponse response;
          EXPECT_TRUE(GatherAt(*stub, "cloud", response, map.version()).ok());
        }
      }
    });
  }
  threads.clear();
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(options_.data_folder)) {
    files.push_back(entry.path().stem());
  }
  EXPECT_EQ(files.size(), 30u);
  for (auto* stub : stubs) EXPECT_THAT(ListAt(*stub), ::testing::UnorderedElementsAreArray(files));
}

TEST_F(ServiceReplicasTest, AMapTheMetadataDoesNotNameIsRefused) {
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
