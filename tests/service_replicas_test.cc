#include <fcntl.h>
#include <sys/stat.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/replicas_fixture.h"

// Several servers on one data folder: each answers for what the others build and delete.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

/// Longer than the time of a folder may stand still: from here on a look at it is a stat.
constexpr auto kSettled = 120ms;

using ServiceReplicasTest = ReplicatedTest;

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

TEST_F(ServiceReplicasTest, AVersionOfAnotherIsShownWhileOneOfThatNameIsWritten) {
  Start();
  auto& other = Replica();
  const Photons many = MakePhotons(2'000'000, 1);
  const auto is_writing = [&] {
    for (const auto& entry : std::filesystem::directory_iterator(options_.data_folder)) {
      if (entry.path().extension() == ".tmp") return true;
    }
    return false;
  };
  int overlaps = 0;
  for (std::uint32_t round = 0; round < 8 && overlaps < 2; ++round) {
    std::atomic<bool> built = false;
    std::thread slow([&] {
      BuildAt(*stub_, "cloud", many);
      built = true;
    });
    while (!is_writing() && !built) std::this_thread::yield();
    const Photons few = MakePhotons(10 + round, round);
    const std::uint64_t version = BuildAt(other, "cloud", few).version();
    // Nothing is the newest but what was built last, which may be the slow one by now.
    v1::GatherResponse answer, pinned;
    EXPECT_TRUE(GatherAt(*stub_, "cloud", answer).ok());
    EXPECT_GE(answer.version(), version);
    EXPECT_TRUE(GatherAt(*stub_, "cloud", pinned, version).ok());
    if (is_writing()) {
      ++overlaps;
      EXPECT_EQ(answer.version(), version);
    }
    slow.join();
    EXPECT_EQ(ListAt(*stub_), ListAt(other));
  }
  if (overlaps == 0) GTEST_SKIP() << "this disk writes 60 MB too fast";
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

}  // namespace
}  // namespace treelight::testing
