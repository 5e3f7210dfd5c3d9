#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "server/snapshot_folder.h"
#include "tests/temporary_folder.h"

// What a loss of power leaves of the data folder: the names that were there when the folder was
// synced last, and of each file the bytes that it had when it was synced itself.
namespace treelight::server {
namespace {

Photons MakePhotons(float x) {
  return {.positions = {x, 2, 3, 4, 5, 6}, .powers = {}, .directions = {}};
}

v1::PhotonMap Describe(std::uint64_t version) {
  v1::PhotonMap map;
  map.set_name("room");
  map.set_version(version);
  map.set_photon_count(2);
  map.mutable_options()->set_builder(v1::BUILDER_KIND_LBVH);
  map.mutable_options()->set_morton_bits(30);
  map.mutable_options()->set_max_leaf_size(8);
  map.set_builder("lbvh");
  return map;
}

class PowerLossTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto folder = SnapshotFolder::Open(before_.path(), [this](int handle) {
      TakeNote(handle);
      return fsync(handle);
    });
    ASSERT_TRUE(folder.ok()) << folder.status();
    folder_ = *std::move(folder);
  }

  std::uint64_t Write(std::uint64_t version, float x) {
    v1::BuildHeader header;
    header.set_name("room");
    header.set_photon_count(2);
    const auto written = folder_->Write(Describe(version), "", KeepRequest(header), MakePhotons(x),
                                        [] { return absl::OkStatus(); });
    EXPECT_TRUE(written.ok()) << written.status();
    return written.value_or(0);
  }

  /// The folder after a loss of power at this moment.
  std::unique_ptr<SnapshotFolder> LosePower() {
    const std::string path = after_.path() + "/" + std::to_string(++losses_);
    std::filesystem::create_directory(path);
    for (const auto& [name, inode] : names_) std::ofstream(path + "/" + name) << bytes_[inode];
    auto folder = SnapshotFolder::Open(path);
    EXPECT_TRUE(folder.ok()) << folder.status();
    return *std::move(folder);
  }

  /// Versions in `folder`, each with the first number of its photons; nothing there is damaged.
  static std::map<std::uint64_t, float> Versions(const SnapshotFolder& folder) {
    std::map<std::uint64_t, float> versions;
    const auto files = folder.CheckAll();
    EXPECT_TRUE(files.ok()) << files.status();
    for (const auto& file : *files) {
      EXPECT_TRUE(file.head.ok()) << file.name << ": " << file.head.status();
      if (!file.head.ok()) continue;
      const std::uint64_t version = file.head->map.version();
      const auto photons = folder.Read("room", version, file.head->checksum);
      EXPECT_TRUE(photons.ok()) << photons.status();
      if (photons.ok()) versions[version] = photons->positions[0];
    }
    return versions;
  }

  std::unique_ptr<SnapshotFolder> folder_;

 private:
  void TakeNote(int handle) {
    struct stat status {};
    ASSERT_EQ(fstat(handle, &status), 0);
    if (!S_ISDIR(status.st_mode)) {
      std::ifstream file("/proc/self/fd/" + std::to_string(handle), std::ios::binary);
      bytes_[status.st_ino] = {std::istreambuf_iterator<char>(file), {}};
      return;
    }
    names_.clear();
    for (const auto& entry : std::filesystem::directory_iterator(before_.path())) {
      struct stat named {};
      ASSERT_EQ(stat(entry.path().c_str(), &named), 0);
      names_[entry.path().filename()] = named.st_ino;
    }
  }

  const testing::TemporaryFolder before_, after_;
  std::map<std::string, ino_t> names_;  // on the disk
  std::map<ino_t, std::string> bytes_;  // likewise
  int losses_ = 0;
};

TEST_F(PowerLossTest, WhatIsWrittenIsThere) {
  EXPECT_TRUE(Versions(*LosePower()).empty());
  Write(1, 10);
  EXPECT_EQ(Versions(*LosePower()), (std::map<std::uint64_t, float>{{1, 10}}));
  Write(2, 20);
  EXPECT_EQ(Versions(*LosePower()), (std::map<std::uint64_t, float>{{1, 10}, {2, 20}}));
}

TEST_F(PowerLossTest, WhatIsRemovedDoesNotComeBack) {
  const std::uint64_t first = Write(1, 10);
  Write(2, 20);
  ASSERT_TRUE(folder_->Remove("room", 1, first).ok());
  EXPECT_EQ(Versions(*LosePower()), (std::map<std::uint64_t, float>{{2, 20}}));
}

TEST_F(PowerLossTest, ASnapshotThatIsNotApprovedIsNotThere) {
  v1::BuildHeader header;
  const auto refused = folder_->Write(Describe(1), "", KeepRequest(header), MakePhotons(1),
                                      [] { return absl::AbortedError("another has it"); });
  EXPECT_TRUE(absl::IsAborted(refused.status()));
  Write(2, 20);
  EXPECT_EQ(Versions(*LosePower()), (std::map<std::uint64_t, float>{{2, 20}}));
}

}  // namespace
}  // namespace treelight::server
