#include <sys/stat.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "server/snapshot_folder.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"
#include "tests/sized_builder.h"
#include "tests/temporary_folder.h"

// Maps in a data folder: over a new start of the server, out of the device and back.
namespace treelight::testing {
namespace {

using ::testing::HasSubstr;

class ServiceDataTest : public ServerTest {
 protected:
  ServiceDataTest() { options_.data_folder = folder_ + "/maps"; }

  void Restart(std::unique_ptr<Builder> builder = MakeBruteForceBuilder()) {
    stub_.reset();
    server_.reset();
    Start(std::move(builder));
  }
  std::vector<std::string> Files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(options_.data_folder)) {
      names.push_back(entry.path().filename());
    }
    std::ranges::sort(names);
    return names;
  }
  std::string File(const std::string& name) const { return options_.data_folder + "/" + name; }
  v1::BuildPhotonMapResponse BuildWithId(const std::string& name, const Photons& photons,
                                         const std::string& id, std::uint64_t ttl_ms = 0) {
    auto messages = MakeUpload(name, photons);
    messages[0].mutable_header()->set_request_id(id);
    messages[0].mutable_header()->set_time_to_live_ms(ttl_ms);
    v1::BuildPhotonMapResponse response;
    const auto status = Build(*stub_, messages, response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }
  grpc::Status GatherAt(const std::string& name, v1::GatherResponse& response) {
    grpc::ClientContext context;
    const std::vector<float> position = {0.5f, 0.5f, 0.5f};
    return stub_->Gather(
        &context, MakeBatch(name, position, {.k = 5, .outputs = kOutputNeighbors | kOutputDensity}),
        &response);
  }
  grpc::Status Delete(const std::string& name, std::uint64_t version) {
    grpc::ClientContext context;
    v1::DeletePhotonMapRequest request;
    request.set_name(name);
    request.set_version(version);
    v1::DeletePhotonMapResponse response;
    return stub_->DeletePhotonMap(&context, request, &response);
  }
  std::vector<v1::PhotonMap> Maps() {
    grpc::ClientContext context;
    v1::ListPhotonMapsResponse response;
    EXPECT_TRUE(stub_->ListPhotonMaps(&context, {}, &response).ok());
    return {response.maps().begin(), response.maps().end()};
  }
  std::uint64_t DeviceBytesUsed() {
    grpc::ClientContext context;
    v1::ServerInfo info;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info.device_bytes_used();
  }

  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
};

TEST_F(ServiceDataTest, MapsComeBackWithAllThatIsToldOfThem) {
  Start(MakeCpuBuilder());
  auto messages = MakeUpload("cloud", MakePhotons(2000, 1));
  auto& header = *messages[0].mutable_header();
  header.set_time_to_live_ms(1'000'000);
  header.mutable_options()->set_builder(v1::BUILDER_KIND_TREELET);
  header.mutable_options()->set_heuristic(v1::HEURISTIC_ISA);
  v1::BuildPhotonMapResponse built;
  ASSERT_TRUE(Build(*stub_, messages, built).ok());
  MustBuild("cloud", MakePhotons(10, 2));
  v1::GatherResponse before;
  auto batch = MakeBatch("cloud", MakePoints(50, 9), {.k = 5, .outputs = 31});
  batch.set_version(1);
  grpc::ClientContext first;
  ASSERT_TRUE(stub_->Gather(&first, batch, &before).ok());
  EXPECT_EQ(Files(), (std::vector<std::string>{"cloud@1.tlmap", "cloud@2.tlmap"}));

  Restart(MakeCpuBuilder());
  const auto maps = Maps();
  ASSERT_EQ(maps.size(), 2u);
  EXPECT_EQ(maps[0].device_bytes(), 0u);  // until it is asked for
  v1::PhotonMap expected = built.map(), told = maps[0];
  expected.clear_device_bytes(), expected.clear_device(), told.clear_device();
  EXPECT_EQ(told.DebugString(), expected.DebugString());
  v1::GatherResponse after;
  grpc::ClientContext second;
  const auto status = stub_->Gather(&second, batch, &after);
  ASSERT_TRUE(status.ok()) << status.error_message();
  before.clear_timings(), after.clear_timings();
  EXPECT_EQ(after.SerializeAsString(), before.SerializeAsString());  // nodes visited too: one tree
  EXPECT_EQ(Maps()[0].device_bytes(), built.map().device_bytes());
  EXPECT_EQ(MustBuild("cloud", MakePhotons(10, 3)).version(), 3u);  // none is used twice
}

TEST_F(ServiceDataTest, WhatIsDeletedOrHasExpiredDoesNotComeBack) {
  Start();
  for (int i = 0; i < 3; ++i) MustBuild("cloud", MakePhotons(10, 1));
  ASSERT_TRUE(Delete("cloud", 2).ok());
  BuildWithId("short", MakePhotons(10, 1), "s", 50);
  const auto later = BuildWithId("later", MakePhotons(10, 1), "l", 1500).map();
  EXPECT_TRUE(Eventually([&] { return !std::filesystem::exists(File("short@1.tlmap")); }));
  EXPECT_EQ(Files(), (std::vector<std::string>{"cloud@1.tlmap", "cloud@3.tlmap", "later@1.tlmap"}));
  stub_.reset(), server_.reset();
  // It expires while no server runs.
  std::this_thread::sleep_until(std::chrono::system_clock::time_point(
      std::chrono::milliseconds(later.expires_unix_ms() + 1)));
  Start();
  ASSERT_EQ(Maps().size(), 2u);
  EXPECT_EQ(Files(), (std::vector<std::string>{"cloud@1.tlmap", "cloud@3.tlmap"}));
  ASSERT_TRUE(Delete("cloud", 0).ok());
  Restart();
  EXPECT_TRUE(Maps().empty());
  EXPECT_TRUE(Files().empty());
}

TEST_F(ServiceDataTest, DamagedFilesAreSetAsideAndTheRestLoads) {
  Start();
  for (const char* name : {"cut", "flipped", "other", "sound"}) MustBuild(name, MakePhotons(99, 1));
  stub_.reset(), server_.reset();
  std::filesystem::resize_file(File("cut@1.tlmap"), 1000);
  {
    std::fstream file(File("flipped@1.tlmap"), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(-10, std::ios::end);
    file.put('x');
  }
  std::filesystem::rename(File("other@1.tlmap"), File("other@2.tlmap"));
  std::ofstream(File("junk@1.tlmap")) << "junk";
  std::ofstream(File("cut@1.tlmap.damaged")) << "of an earlier start";
  std::ofstream(File("readme")) << "is left alone";
  std::ofstream(File("sound@2.tlmap.abcdef.tmp")) << "of a writer that was killed";
  ::testing::internal::CaptureStderr();
  Start();
  const std::string told = ::testing::internal::GetCapturedStderr();
  EXPECT_EQ(Maps().size(), 1u);
  EXPECT_THAT(told, HasSubstr("'cut@1.tlmap' is damaged: 1000 bytes long, 99 photons take"));
  EXPECT_THAT(told, HasSubstr("set aside as 'cut@1.tlmap.damaged.1'"));
  EXPECT_THAT(told, HasSubstr("'flipped@1.tlmap' is damaged: block 2"));
  EXPECT_THAT(told, HasSubstr("'other@2.tlmap' is damaged: it holds 'other@1.tlmap'"));
  EXPECT_THAT(told, HasSubstr("'junk@1.tlmap' is damaged: 4 bytes are too few"));
  EXPECT_EQ(Files(),
            (std::vector<std::string>{"cut@1.tlmap.damaged", "cut@1.tlmap.damaged.1",
                                      "flipped@1.tlmap.damaged", "junk@1.tlmap.damaged",
                                      "other@2.tlmap.damaged", "readme", "sound@1.tlmap"}));
  v1::GatherResponse response;
  EXPECT_TRUE(GatherAt("sound", response).ok());
}

TEST_F(ServiceDataTest, AFileOfALaterProgramStaysAndItsVersionIsNotTaken) {
  Start();
  MustBuild("cloud", MakePhotons(10, 1));
  stub_.reset(), server_.reset();
  {
    std::fstream file(File("cloud@1.tlmap"), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(8);
    file.put(99);
  }
  ::testing::internal::CaptureStderr();
  Start();
  EXPECT_THAT(::testing::internal::GetCapturedStderr(),
              HasSubstr("'cloud@1.tlmap' is not loaded: format version 99"));
  EXPECT_TRUE(Maps().empty());
  EXPECT_EQ(MustBuild("cloud", MakePhotons(10, 1)).version(), 2u);
  EXPECT_EQ(Files(), (std::vector<std::string>{"cloud@1.tlmap", "cloud@2.tlmap"}));
}

TEST_F(ServiceDataTest, WhatIsNoFileIsToldOnceAndStaysOrIsSetAside) {
  Start();
  MustBuild("cloud", MakePhotons(10, 1));
  stub_.reset(), server_.reset();
  std::filesystem::create_symlink(File("cloud@1.tlmap"), File("link@1.tlmap"));
  ASSERT_EQ(mkfifo(File("pipe@1.tlmap").c_str(), 0600), 0);
  ::testing::internal::CaptureStderr();
  Start();
  // Each build changes the folder, which is then looked at again.
  for (std::uint64_t version = 2; version < 5; ++version) {
    EXPECT_EQ(MustBuild("cloud", MakePhotons(10, 1)).version(), version);
    EXPECT_EQ(Maps().size(), version);
  }
  const std::string folder = "treelightd: data folder '" + options_.data_folder + "': ";
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            folder + "'link@1.tlmap' is not loaded: it is a symbolic link\n" + folder +
                "'pipe@1.tlmap' is damaged: it is no regular file; set aside as "
                "'pipe@1.tlmap.damaged'\n");
}

TEST_F(ServiceDataTest, AFileThatIsDamagedWhileTheServerRunsCostsItsMapAlone) {
  Start();
  MustBuild("cloud", MakePhotons(99, 1));
  MustBuild("sound", MakePhotons(99, 2));
  Restart();
  {
    std::fstream file(File("cloud@1.tlmap"), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(-10, std::ios::end);
    file.put('x');
  }
  v1::GatherResponse response;
  ::testing::internal::CaptureStderr();
  const auto status = GatherAt("cloud", response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_THAT(status.error_message(), HasSubstr("'cloud@1.tlmap' of the data folder: block 2"));
  EXPECT_EQ(GatherAt("cloud", response).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_TRUE(GatherAt("sound", response).ok());
  EXPECT_THAT(::testing::internal::GetCapturedStderr(),
              HasSubstr("'cloud@1.tlmap' is damaged: block 2"));
  EXPECT_EQ(Files(), (std::vector<std::string>{"cloud@1.tlmap.damaged", "sound@1.tlmap"}));
}

TEST_F(ServiceDataTest, ABuildThatCannotBeWrittenLeavesNoMap) {
  Start();
  // Where the folder has gone, nothing can be written into it, also not by root.
  std::filesystem::remove_all(options_.data_folder);
  v1::BuildPhotonMapResponse response;
  const auto status = Build(*stub_, MakeUpload("cloud", MakePhotons(10, 1)), response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_THAT(status.error_message(), HasSubstr("data folder '" + options_.data_folder + "'"));
  EXPECT_TRUE(Maps().empty());
}

TEST_F(ServiceDataTest, IdleMapsLeaveTheDeviceForOthersAndComeBack) {
  // Host memory for about two maps of a CPU, beside an upload.
  options_.devices = {MakeCpu()};
  options_.memory_limit = 64 << 20;
  Start(std::make_unique<SizedBuilder>());
  constexpr std::size_t kCount = 200'000;
  std::vector<Photons> photons;
  for (std::uint32_t i = 0; i < 8; ++i) {
    photons.push_back(MakePhotons(kCount, i));
    MustBuild("map" + std::to_string(i), photons.back());
  }
  EXPECT_EQ(Maps().size(), 8u);
  const auto resident = [&] {
    return std::ranges::count_if(Maps(), [](const auto& map) { return map.device_bytes() > 0; });
  };
  EXPECT_LT(resident(), 8);
  EXPECT_GT(resident(), 0);
  EXPECT_LE(DeviceBytesUsed(), options_.memory_limit);
  for (const std::size_t i : {0, 5, 1, 7, 0, 3, 2, 6, 4, 0}) {
    v1::GatherResponse response;
    const auto status = GatherAt("map" + std::to_string(i), response);
    ASSERT_TRUE(status.ok()) << i << ": " << status.error_message();
    const auto expected = Expected(photons[i], {0.5f, 0.5f, 0.5f}, {.k = 5, .outputs = 4});
    EXPECT_EQ(Array<std::uint32_t>(response.neighbor_ids()), expected.neighbor_ids);
    EXPECT_LE(DeviceBytesUsed(), options_.memory_limit);
    EXPECT_GT(Maps()[i].device_bytes(), 0u);
  }
}

TEST_F(ServiceDataTest, AMapOffTheDeviceIsRebuiltFromAndDeleted) {
  Start(MakeCpuBuilder());
  MustBuild("cloud", MakePhotons(100, 1));
  MustBuild("gone", MakePhotons(100, 1));
  Restart(MakeCpuBuilder());
  MustRebuild("cloud", "again");
  EXPECT_EQ(Maps()[1].device_bytes(), 0u);  // the source stays off
  EXPECT_TRUE(Delete("gone", 1).ok());
  EXPECT_EQ(Files(), (std::vector<std::string>{"again@1.tlmap", "cloud@1.tlmap"}));
}

TEST_F(ServiceDataTest, TwoServersOnOneFolderNeverWriteOneVersion) {
  Start();
  auto other = server::Server::Start(options_, MakeBruteForceBuilder());
  ASSERT_TRUE(other.ok());
  const auto other_stub = v1::PhotonMapService::NewStub((*other)->InProcessChannel());
  constexpr int kBuilds = 25;
  const auto build = [](v1::PhotonMapService::Stub& stub, std::uint32_t seed) {
    for (int i = 0; i < kBuilds; ++i) {
      v1::BuildPhotonMapResponse response;
      EXPECT_TRUE(Build(stub, MakeUpload("cloud", MakePhotons(10, seed)), response).ok());
    }
  };
  {
    const std::jthread here([&] { build(*stub_, 1); });
    const std::jthread there([&] { build(*other_stub, 2); });
  }
  EXPECT_EQ(Files().size(), 2u * kBuilds);
}

}  // namespace
}  // namespace treelight::testing
