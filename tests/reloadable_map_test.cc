#include "server/reloadable_map.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "server/merged_maps.h"

// Trees that come and go while several threads ask for them, without a device: what ThreadSanitizer
// can see into.
namespace treelight::server {
namespace {

constexpr std::uint64_t kBytes = 1000;

/// A map of one photon that says what it holds.
class SmallMap final : public Gatherer {
 public:
  absl::StatusOr<GatherResult> Gather(const GatherQueries&, const GatherOptions&,
                                      const CancelCheck&) const override {
    return GatherResult{};
  }
  absl::StatusOr<Tree> ReadTree() const override { return Tree{}; }
  absl::StatusOr<Photons> ReadPhotons() const override {
    return Photons{.positions = {1, 2, 3}, .powers = {}, .directions = {}};
  }
  std::size_t photon_count() const override { return 1; }
  bool has_powers() const override { return false; }
  bool has_directions() const override { return false; }
  const BuildReport& report() const override { return report_; }

 private:
  const BuildReport report_ = [] {
    BuildReport report;
    report.device_bytes = kBytes;
    return report;
  }();
};

std::shared_ptr<const ResidentTree> SmallTree() {
  return std::make_shared<const ResidentTree>(
      ResidentTree{.gatherer = std::make_unique<SmallMap>(), .memory = {}});
}

/// Photons in memory, while the tree is away.
class MemoryKeeper final : public PhotonKeeper {
 public:
  bool has_photons() const override { return false; }
  absl::Status Save(const Gatherer& gatherer) override {
    auto photons = gatherer.ReadPhotons();
    if (!photons.ok()) return photons.status();
    const std::lock_guard lock(mutex_);
    if (is_full_) return absl::ResourceExhaustedError("no room");
    photons_ = *std::move(photons);
    return absl::OkStatus();
  }
  void Forget() override {
    const std::lock_guard lock(mutex_);
    photons_ = {};
  }
  absl::StatusOr<Photons> Read() override {
    const std::lock_guard lock(mutex_);
    if (photons_.positions.empty()) return absl::NotFoundError("nothing is kept");
    return photons_;
  }
  void Fill() {
    const std::lock_guard lock(mutex_);
    is_full_ = true;
  }

 private:
  std::mutex mutex_;
  Photons photons_;       // guarded by mutex_
  bool is_full_ = false;  // guarded by mutex_
};

class ReloadableMapTest : public ::testing::Test {
 protected:
  const std::shared_ptr<MemoryKeeper> keeper_ = std::make_shared<MemoryKeeper>();
  std::atomic<int> loads_ = 0;
  ReloadableMap map_{{.photon_count = 1, .report = {}},
                     [this](const CancelCheck&) {
                       ++loads_;
                       return SmallTree();
                     },
                     keeper_,
                     SmallTree()};
};

TEST_F(ReloadableMapTest, ATreeThatLeavesComesBackOnUse) {
  EXPECT_EQ(map_.held_bytes(), kBytes);
  ASSERT_NE(map_.Evict(), nullptr);
  EXPECT_FALSE(map_.resident());
  EXPECT_EQ(map_.held_bytes(), 0u);
  EXPECT_EQ(map_.Evict(), nullptr);
  EXPECT_EQ(map_.ReadPhotons()->positions.size(), 3u);  // of the keeper
  EXPECT_TRUE(map_.Gather({}, {}, {}).ok());
  EXPECT_EQ(loads_, 1);
  EXPECT_TRUE(map_.resident());
  EXPECT_TRUE(absl::IsNotFound(keeper_->Read().status()));
}

TEST_F(ReloadableMapTest, ATreeInUseAndOneThatCannotBeKeptStay) {
  {
    const auto used = map_.Acquire({});
    EXPECT_EQ(map_.Evict(), nullptr);
  }
  keeper_->Fill();
  EXPECT_EQ(map_.Evict(), nullptr);
  EXPECT_TRUE(map_.resident());
  EXPECT_EQ(loads_, 0);
}

TEST_F(ReloadableMapTest, OneOfManyThreadsExpectsTheLoad) {
  std::atomic<int> first = 0;
  {
    std::vector<std::shared_ptr<const void>> tokens(4);
    {
      std::vector<std::jthread> threads;
      for (auto& token : tokens) {
        threads.emplace_back([&] {
          token = map_.ExpectLoad();
          if (token != nullptr) ++first;
        });
      }
    }
    EXPECT_EQ(first, 1);
  }
  EXPECT_NE(map_.ExpectLoad(), nullptr);
}

TEST_F(ReloadableMapTest, OneThreadUsesItAndOthersLookAndLetItGo) {
  std::atomic<bool> end = false;
  std::vector<std::jthread> others;
  for (int i = 0; i < 2; ++i) {
    others.emplace_back([&] {
      while (!end) {
        map_.Evict();
        EXPECT_LE(map_.held_bytes(), kBytes);
        const auto photons = map_.ReadPhotons();
        EXPECT_TRUE(photons.ok()) << photons.status();
        const auto used = map_.last_use();
        EXPECT_LE(used, std::chrono::steady_clock::now());
      }
    });
  }
  for (int i = 0; i < 2000; ++i) ASSERT_TRUE(map_.Gather({}, {}, {}).ok());
  end = true;
}

TEST(MergedMapsTest, ThreadsKeepFindAndDropThem) {
  MergedMaps maps;
  std::atomic<std::uint64_t> dropped = 0;
  {
    std::vector<std::jthread> threads;
    for (unsigned thread = 0; thread < 4; ++thread) {
      threads.emplace_back([&, thread] {
        for (int i = 0; i < 500; ++i) {
          maps.Keep({.group_size = thread}, {SmallTree(), 2});
          const ResidentFewer found = maps.Find({.group_size = (thread + 1) % 4});
          if (found.tree != nullptr) {
            EXPECT_EQ(found.tree->gatherer->photon_count(), 1u);
            EXPECT_EQ(found.photon_power, 2);
          }
          EXPECT_LE(maps.held_bytes(), 4 * kBytes);
          dropped += maps.Drop();
        }
      });
    }
  }
  maps.Drop();
  EXPECT_EQ(maps.held_bytes(), 0u);
  EXPECT_GT(dropped, 0u);
}

}  // namespace
}  // namespace treelight::server
