#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server_fixture.h"
#include "tests/server_process.h"
#include "tests/temporary_folder.h"

// --data-dir under SIGKILL, on a full disk, and as `treelightd fsck` sees it.
namespace treelight::testing {
namespace {

using ::testing::HasSubstr;

class ServerDataTest : public ::testing::Test {
 protected:
  std::vector<std::string> Arguments() const {
    return {"--listen", "127.0.0.1:0", "--data-dir", maps_};
  }
  static grpc::Status BuildWithId(v1::PhotonMapService::Stub& stub, const std::string& name,
                                  const Photons& photons, const std::string& id,
                                  v1::BuildPhotonMapResponse& response) {
    auto messages = MakeUpload(name, photons);
    messages[0].mutable_header()->set_request_id(id);
    return Build(stub, messages, response);
  }

  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
  const std::string maps_ = folder_ + "/maps";
};

/// A build that was answered, or a delete.
struct Answered {
  std::string name, id;
  std::uint64_t version = 0;
  std::uint32_t photon_count = 0, seed = 0;
  std::int64_t created_unix_ms = 0;
};

TEST_F(ServerDataTest, WhatWasAnsweredSurvivesSigkill) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::vector<Answered> answered;
  std::vector<Answered> deleted;
  std::uint32_t number = 0;
  constexpr int kLives = 5;
  for (int life = 0; life < kLives; ++life) {
    Process server(Arguments());
    const std::string address = server.WaitUntilReady();
    ASSERT_FALSE(address.empty()) << server.err();
    EXPECT_EQ(server.err().find("damaged"), std::string::npos) << server.err();
    const auto stub = Connect(address);

    // All that was answered in earlier lives is here, with its photons; all that was deleted is
    // not.
    for (const Answered& map : answered) {
      grpc::ClientContext context;
      auto batch = MakeBatch(map.name, {0.5f, 0.5f, 0.5f}, {.k = 3, .outputs = kOutputNeighbors});
      batch.set_version(map.version);
      v1::GatherResponse response;
      const auto status = stub->Gather(&context, batch, &response);
      ASSERT_TRUE(status.ok()) << map.name << "@" << map.version << ": " << status.error_message();
      const auto brute_force =
          MakeBruteForceBuilder()->Build(MakePhotons(map.photon_count, map.seed), {});
      const std::vector<float> center = {0.5f, 0.5f, 0.5f};
      const auto expected =
          (*brute_force)->Gather({.positions = center}, {.k = 3, .outputs = kOutputNeighbors});
      EXPECT_EQ(Array<std::uint32_t>(response.neighbor_ids()), expected->neighbor_ids);
    }
    for (const Answered& map : deleted) {
      grpc::ClientContext context;
      v1::GetPhotonMapRequest request;
      request.set_name(map.name);
      request.set_version(map.version);
      v1::PhotonMap response;
      const auto status = stub->GetPhotonMap(&context, request, &response);
      // A new start may give the last version anew, to another map.
      const bool other = status.ok() && response.created_unix_ms() > map.created_unix_ms;
      EXPECT_TRUE(other || status.error_code() == grpc::StatusCode::NOT_FOUND) << map.name;
    }
    // A repeat of the last build, which may have been cut off, makes no second map.
    if (!answered.empty()) {
      const Answered& last = answered.back();
      v1::BuildPhotonMapResponse response;
      ASSERT_TRUE(BuildWithId(*stub, last.name, MakePhotons(last.photon_count, last.seed), last.id,
                              response)
                      .ok());
      EXPECT_EQ(response.map().version(), last.version);
    }

    // Builds and deletes until the kill.
    std::thread killer([&, pause = 30 + random() % 400] {
      std::this_thread::sleep_for(std::chrono::milliseconds(pause));  // a moment by chance
      server.Signal(SIGKILL);
    });
    while (true) {
      if (answered.size() > 3 && random() % 4 == 0) {
        const std::size_t which = random() % answered.size();
        grpc::ClientContext context;
        v1::DeletePhotonMapRequest request;
        request.set_name(answered[which].name);
        request.set_version(answered[which].version);
        v1::DeletePhotonMapResponse response;
        const auto status = stub->DeletePhotonMap(&context, request, &response);
        // Of a delete that was cut off nothing is known.
        if (status.ok()) deleted.push_back(answered[which]);
        answered.erase(answered.begin() + static_cast<std::ptrdiff_t>(which));
        if (!status.ok()) break;
        continue;
      }
      Answered map{.name = "map" + std::to_string(random() % 3),
                   .id = "build" + std::to_string(number),
                   .photon_count = 1 + static_cast<std::uint32_t>(random() % 50'000),
                   .seed = number++};
      v1::BuildPhotonMapResponse response;
      if (!BuildWithId(*stub, map.name, MakePhotons(map.photon_count, map.seed), map.id, response)
               .ok()) {
        break;
      }
      map.version = response.map().version();
      map.created_unix_ms = static_cast<std::int64_t>(response.map().created_unix_ms());
      answered.push_back(map);
    }
    killer.join();
    server.Wait();
  }
  Process fsck({"fsck", "--data-dir", maps_});
  EXPECT_EQ(fsck.Wait(), 0) << fsck.out();
  std::cout << kLives << " kills, " << answered.size() << " maps and " << deleted.size()
            << " deletes answered, none lost\n";
}

TEST_F(ServerDataTest, AFullDiskRefusesTheBuildAndNothingElse) {
  std::filesystem::create_directory(maps_);
  const std::vector<std::string> small_disk = {
      "unshare",
      "--mount",
      "sh",
      "-c",
      "mount -t tmpfs -o size=4m none " + maps_ + " && exec \"$@\"",
      "sh"};
  Process server(small_disk, Arguments());
  const std::string address = server.WaitUntilReadyOrEnded();
  if (address.empty()) GTEST_SKIP() << "no file system can be mounted here: " << server.err();
  const auto stub = Connect(address);
  v1::BuildPhotonMapResponse response;
  // Larger than the disk: refused by its header.
  auto messages = MakeUpload("large", MakePhotons(200'000, 1));
  auto status = Build(*stub, messages, response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(),
              HasSubstr("header.photon_count is 200000: its file takes up "));
  // One that the disk had room for when it began: somebody else fills it meanwhile.
  const std::string disk = "/proc/" + std::to_string(server.pid()) + "/root" + maps_;
  {
    messages = MakeUpload("late", MakePhotons(30'000, 1));
    grpc::ClientContext context;
    const auto upload = stub->BuildPhotonMap(&context, &response);
    ASSERT_TRUE(upload->Write(messages[0]));
    v1::ServerInfo info;
    grpc::ClientContext first;
    ASSERT_TRUE(stub->GetServerInfo(&first, {}, &info).ok());  // the header has been taken up
    std::ofstream(disk + "/filler") << std::string(3'700'000, 'x');
    for (const auto& message : std::span(messages).subspan(1)) upload->Write(message);
    upload->WritesDone();
    status = upload->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_THAT(status.error_message(),
                HasSubstr("map 'late' with 30000 photons does not fit the disk of data folder"));
    std::filesystem::remove(disk + "/filler");
    EXPECT_TRUE(std::filesystem::is_empty(disk));
  }
  // It fills up; what was built is still there and answers.
  int built = 0;
  for (; built < 20; ++built) {
    status =
        BuildWithId(*stub, "map", MakePhotons(30'000, 1), "id" + std::to_string(built), response);
    if (!status.ok()) break;
  }
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
  EXPECT_THAT(status.error_message(), HasSubstr("data folder '" + maps_ + "'"));
  EXPECT_GE(built, 2);
  const auto list = [&] {
    grpc::ClientContext context;
    v1::ListPhotonMapsResponse maps;
    EXPECT_TRUE(stub->ListPhotonMaps(&context, {}, &maps).ok());
    return maps.maps_size();
  };
  EXPECT_EQ(list(), built);
  grpc::ClientContext context;
  v1::DeletePhotonMapRequest request;
  request.set_name("map");
  request.set_version(1);
  v1::DeletePhotonMapResponse deleted;
  EXPECT_TRUE(stub->DeletePhotonMap(&context, request, &deleted).ok());
  EXPECT_TRUE(BuildWithId(*stub, "map", MakePhotons(30'000, 1), "again", response).ok());
  EXPECT_EQ(list(), built);
}

TEST_F(ServerDataTest, FsckTellsWhatIsDamagedAndChangesNothing) {
  Process none({"fsck", "--data-dir", maps_});
  EXPECT_EQ(none.Wait(), 1);
  EXPECT_EQ(none.err(), "treelightd: data folder '" + maps_ + "': there is none\n");
  EXPECT_FALSE(std::filesystem::exists(maps_));
  {
    Process server(Arguments());
    const auto stub = Connect(server.WaitUntilReady());
    v1::BuildPhotonMapResponse response;
    for (const char* name : {"a", "b"}) {
      ASSERT_TRUE(BuildWithId(*stub, name, MakePhotons(1000, 1), name, response).ok());
    }
    server.Signal(SIGTERM);
    EXPECT_EQ(server.Wait(), 0);
  }
  Process sound({"fsck", "--data-dir", maps_});
  EXPECT_EQ(sound.Wait(), 0);
  EXPECT_THAT(sound.out(), HasSubstr("a@1.tlmap: sound, 1000 photons\nb@1.tlmap: sound"));
  EXPECT_THAT(sound.out(), HasSubstr("2 maps, 2000 photons, "));
  std::filesystem::resize_file(maps_ + "/b@1.tlmap", 5000);
  Process damaged({"fsck", "--data-dir", maps_});
  EXPECT_EQ(damaged.Wait(), 1);
  EXPECT_THAT(damaged.out(), HasSubstr("b@1.tlmap: damaged: 5000 bytes long, 1000 photons take"));
  EXPECT_TRUE(std::filesystem::exists(maps_ + "/b@1.tlmap"));
  std::filesystem::remove(maps_ + "/b@1.tlmap");
  std::filesystem::create_symlink("a@1.tlmap", maps_ + "/b@1.tlmap");
  std::filesystem::copy(maps_ + "/a@1.tlmap", maps_ + "/c@1.tlmap");
  std::fstream(maps_ + "/c@1.tlmap", std::ios::in | std::ios::out | std::ios::binary)
      .seekp(8)
      .put(99);
  Process unread({"fsck", "--data-dir", maps_});
  EXPECT_EQ(unread.Wait(), 1);
  EXPECT_THAT(unread.out(), HasSubstr("b@1.tlmap: not checked: it is a symbolic link\n"
                                      "c@1.tlmap: not checked: format version 99"));
  const auto bytes = std::to_string(std::filesystem::file_size(maps_ + "/a@1.tlmap"));
  EXPECT_THAT(unread.out(),
              HasSubstr("1 maps, 1000 photons, " + bytes + " bytes; 0 damaged, 2 not"));
  std::filesystem::remove(maps_ + "/b@1.tlmap");
  std::filesystem::rename(maps_ + "/c@1.tlmap", maps_ + "/c@1.tlmap.damaged.2");
  Process aside({"fsck", "--data-dir", maps_});
  EXPECT_EQ(aside.Wait(), 1);
  EXPECT_EQ(aside.out(),
            "a@1.tlmap: sound, 1000 photons\n"
            "c@1.tlmap.damaged.2: a server has set it aside\n"
            "1 maps, 1000 photons, " +
                bytes + " bytes; 0 damaged, 0 not checked, 1 set aside\n");
  Process unnamed({"fsck"});
  EXPECT_EQ(unnamed.Wait(), 2);
  Process impossible({"fsck", "--data-dir", folder_ + "/" + std::string(300, 'x')});
  EXPECT_EQ(impossible.Wait(), 1);
  EXPECT_THAT(impossible.err(), HasSubstr("File name too long\n"));
}

/// What a loss of power may take away is what was not synced: the order of the system calls.
TEST_F(ServerDataTest, AFileIsSyncedBeforeItHasItsNameAndTheFolderBeforeTheAnswer) {
  if (std::system("command -v strace >/dev/null") != 0) GTEST_SKIP() << "strace is not installed";
  const std::string trace = folder_ + "/trace";
  // -D: the process that is started is the server, and strace its grandchild.
  Process server({"strace", "-D", "-f", "-y", "-o", trace, "-e", "trace=fsync,renameat2,unlinkat"},
                 Arguments());
  const std::string address = server.WaitUntilReadyOrEnded();
  if (address.empty()) GTEST_SKIP() << "processes cannot be traced here: " << server.err();
  const auto stub = Connect(address);
  v1::BuildPhotonMapResponse response;
  ASSERT_TRUE(BuildWithId(*stub, "map", MakePhotons(1000, 1), "id", response).ok());
  std::ostringstream text;
  text << std::ifstream(trace).rdbuf();
  const std::string calls = text.str();
  const std::size_t file = calls.find(".tmp>)"), name = calls.find("renameat2("),
                    folder = calls.find("maps>)", name);
  EXPECT_LT(file, name) << calls;
  EXPECT_LT(name, folder) << calls;
  EXPECT_NE(folder, std::string::npos) << calls;
  EXPECT_EQ(calls.substr(calls.rfind("fsync", file), 5), "fsync");
}

}  // namespace
}  // namespace treelight::testing
