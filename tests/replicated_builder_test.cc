#include "core/replicated_builder.h"

#include <atomic>
#include <chrono>
#include <limits>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/clouds.h"
#include "tests/forwarding_gatherer.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr std::uint32_t kExact = kOutputCount | kOutputRadius | kOutputNeighbors;

/// What the devices of a test do, and did.
struct Doings {
  std::vector<std::size_t> batches;  // sizes, one after the other
  std::atomic<bool> fails = false, waits = false;
  std::atomic<int> stopped = 0;
};

/// A map that writes down what it is asked, and fails or waits to be stopped where told.
class WatchedGatherer : public testing::ForwardingGatherer {
 public:
  WatchedGatherer(std::shared_ptr<Doings> doings, std::unique_ptr<Gatherer> map)
      : ForwardingGatherer(std::move(map)), doings_(std::move(doings)) {}

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    doings_->batches.push_back(queries.size());
    if (doings_->fails) return absl::InternalError("the device is lost");
    while (doings_->waits) {
      if (cancelled && cancelled()) {
        ++doings_->stopped;
        return absl::CancelledError("stopped");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return ForwardingGatherer::Gather(queries, options, cancelled);
  }

 private:
  const std::shared_ptr<Doings> doings_;
};

/// A CPU whose maps are watched, and whose builds fail or wait likewise.
class WatchedBuilder : public Builder {
 public:
  explicit WatchedBuilder(std::shared_ptr<Doings> doings) : doings_(std::move(doings)) {}

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    if (doings_->fails) return absl::ResourceExhaustedError("the device is full");
    while (doings_->waits) {
      if (cancelled && cancelled()) {
        ++doings_->stopped;
        return absl::CancelledError("stopped");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    auto map = cpu_->Build(photons, options, cancelled);
    if (!map.ok()) return map.status();
    return std::make_unique<WatchedGatherer>(doings_, *std::move(map));
  }
  std::uint64_t WorkBytes(const BuildOptions&, std::uint64_t photon_count) const override {
    return 3 * photon_count;
  }

 private:
  const std::shared_ptr<Doings> doings_;
  const std::unique_ptr<Builder> cpu_ = MakeCpuBuilder();
};

/// Two watched devices as one.
class ReplicatedBuilderTest : public ::testing::Test {
 protected:
  ReplicatedBuilderTest() {
    std::vector<std::unique_ptr<Builder>> devices;
    for (const auto& doings : doings_) devices.push_back(std::make_unique<WatchedBuilder>(doings));
    builder_ = MakeReplicatedBuilder(std::move(devices));
  }

  std::unique_ptr<Gatherer> Build() { return *builder_->Build(photons_, {}); }

  const Photons photons_ = MakeCloud(CloudNamed("uniform"), 2000, 1);
  const std::vector<float> queries_ = MakeQueries(photons_, 2 * kFewestSplitQueries + 1, 2);
  const std::vector<std::shared_ptr<Doings>> doings_ = {std::make_shared<Doings>(),
                                                        std::make_shared<Doings>()};
  std::unique_ptr<Builder> builder_;
};

void ExpectEqual(const GatherResult& a, const GatherResult& b) {
  EXPECT_EQ(a.counts, b.counts);
  EXPECT_EQ(a.radii, b.radii);
  EXPECT_EQ(a.neighbor_ids, b.neighbor_ids);
  EXPECT_EQ(a.neighbor_squared_distances, b.neighbor_squared_distances);
  EXPECT_EQ(a.neighbor_offsets, b.neighbor_offsets);
  EXPECT_EQ(a.densities, b.densities);
  EXPECT_EQ(a.nodes_visited, b.nodes_visited);
  EXPECT_EQ(a.distance_tests, b.distance_tests);
  EXPECT_EQ(a.error_bounds, b.error_bounds);
}

// What one device answers, two answer: every cloud, with arrays for each query, over fresh seeds.
TEST_F(ReplicatedBuilderTest, AnswersAreThoseOfOneDevice) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE(::testing::Message() << "seed " << seed);
  const auto one = MakeCpuBuilder();
  for (const CloudShape& shape : AllClouds()) {
    SCOPED_TRACE(shape.name);
    const Photons photons = MakeCloud(shape, 500, seed);
    const auto positions = MakeQueries(photons, 2 * kFewestSplitQueries + 1, seed);
    const std::size_t count = positions.size() / 3;
    const std::vector<float> normals(positions.size(), 0.577f);
    std::vector<float> radii(count);
    for (std::size_t i = 0; i < count; ++i) radii[i] = static_cast<float>(i % 7) * 0.1f;
    const auto alone = one->Build(photons, {});
    const auto both = builder_->Build(photons, {});
    ASSERT_TRUE(alone.ok() && both.ok()) << alone.status() << both.status();
    for (const GatherOptions& options :
         {GatherOptions{.k = 5, .outputs = kExact},
          GatherOptions{.k = 3, .outputs = kOutputDensity | kOutputStatistics},
          GatherOptions{.k = 0, .radius = 0.1f, .outputs = kOutputCount | kOutputDensity}}) {
      const GatherQueries queries{.positions = positions, .normals = normals, .radii = radii};
      const auto expected = (*alone)->Gather(queries, options);
      const auto found = (*both)->Gather(queries, options);
      ASSERT_TRUE(expected.ok() && found.ok()) << expected.status() << found.status();
      ExpectEqual(*found, *expected);
    }
  }
  for (const auto& doings : doings_) EXPECT_GT(doings->batches.size(), AllClouds().size());
}

// Which approximation a query gets depends on the queries beside it; its bound holds.
TEST_F(ReplicatedBuilderTest, ApproximateAnswersHaveTheirBounds) {
  const auto map = Build();
  const auto found =
      map->Gather({.positions = queries_},
                  {.k = 4, .outputs = kOutputRadius, .approximation = {.epsilon = 0.5f}});
  const auto exact = map->Gather({.positions = queries_}, {.k = 4, .outputs = kOutputRadius});
  ASSERT_TRUE(found.ok() && exact.ok()) << found.status() << exact.status();
  ASSERT_EQ(found->error_bounds.size(), queries_.size() / 3);
  for (std::size_t i = 0; i < found->radii.size(); ++i) {
    ASSERT_LE(found->radii[i], exact->radii[i] * (1 + found->error_bounds[i]) * (1 + 1e-6f)) << i;
  }
}

// Devices of two kinds have the same tree.
TEST_F(ReplicatedBuilderTest, ACpuAndADeviceOfOpenClAnswerAsOne) {
  std::vector<std::unique_ptr<Builder>> devices;
  devices.push_back(MakeCpuBuilder("first"));
  auto open_cl = MakeDeviceBuilder({std::to_string(ListDevices().size() - 1), {}});
  ASSERT_TRUE(open_cl.ok()) << open_cl.status();
  devices.push_back(*std::move(open_cl));
  const auto both = MakeReplicatedBuilder(std::move(devices));
  const auto map = *both->Build(photons_, {});
  const auto alone = *MakeCpuBuilder()->Build(photons_, {});
  const GatherOptions options{.k = 20, .outputs = kExact};
  const auto found = map->Gather({.positions = queries_}, options);
  ASSERT_TRUE(found.ok()) << found.status();
  ExpectEqual(*found, *alone->Gather({.positions = queries_}, options));
  EXPECT_GT(found->times.kernel_us, 0);
  EXPECT_FALSE(found->search.empty());
  EXPECT_TRUE(map->report().device.starts_with("first + ")) << map->report().device;
  EXPECT_EQ(map->photon_count(), photons_.size());
  EXPECT_EQ(map->ReadPhotons()->positions, photons_.positions);
}

TEST_F(ReplicatedBuilderTest, ABatchIsCutIntoEqualPartsWhereThatFillsThem) {
  const auto map = Build();
  const auto gather = [&](std::size_t count, const GatherOptions& options) {
    for (const auto& doings : doings_) doings->batches.clear();
    const auto found = map->Gather({.positions = std::span(queries_).first(3 * count)}, options);
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_EQ(found->counts.size(), count);
  };
  const GatherOptions counts{.k = 0, .radius = 0.01f, .outputs = kOutputCount};
  gather(2 * kFewestSplitQueries + 1, counts);
  EXPECT_EQ(doings_[0]->batches, std::vector<std::size_t>{kFewestSplitQueries});
  EXPECT_EQ(doings_[1]->batches, std::vector<std::size_t>{kFewestSplitQueries + 1});
  // Fewer go to one, then the other.
  gather(2 * kFewestSplitQueries - 1, counts);
  const bool first = !doings_[0]->batches.empty();
  EXPECT_EQ(doings_[first ? 1 : 0]->batches.size(), 0u);
  gather(1, counts);
  EXPECT_EQ(doings_[first ? 1 : 0]->batches, std::vector<std::size_t>{1});
  EXPECT_EQ(doings_[first ? 0 : 1]->batches.size(), 0u);
  // Lists without a cap stay whole.
  gather(2 * kFewestSplitQueries + 1,
         {.k = 0, .radius = 0.01f, .outputs = kOutputCount | kOutputNeighbors});
  EXPECT_EQ(doings_[0]->batches.size() + doings_[1]->batches.size(), 1u);
}

TEST_F(ReplicatedBuilderTest, MistakesAreToldOfTheWholeBatch) {
  const auto map = Build();
  std::vector<float> positions = queries_;
  const std::size_t last = positions.size() - 1;
  positions[last] = std::numeric_limits<float>::quiet_NaN();
  const auto found = map->Gather({.positions = positions}, {.k = 1});
  EXPECT_EQ(found.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(found.status().message().find(std::to_string(last)), std::string::npos)
      << found.status();
  const std::size_t count = queries_.size() / 3;
  const GatherOptions lists{.k = 2, .outputs = kOutputNeighbors, .max_neighbors = 2 * count - 1};
  EXPECT_EQ(map->Gather({.positions = queries_}, lists).status().code(),
            absl::StatusCode::kResourceExhausted);
}

TEST_F(ReplicatedBuilderTest, WhatFailsOnOneFailsAndStopsTheOther) {
  const auto map = Build();
  doings_[0]->waits = true;
  doings_[1]->fails = true;
  const auto found = map->Gather({.positions = queries_}, {.k = 1});
  EXPECT_EQ(found.status(), absl::InternalError("the device is lost"));
  EXPECT_EQ(doings_[0]->stopped, 1);
  EXPECT_EQ(builder_->Build(photons_, {}).status(),
            absl::ResourceExhaustedError("the device is full"));
  EXPECT_EQ(doings_[0]->stopped, 2);
  doings_[0]->waits = false;
  doings_[1]->fails = false;
  EXPECT_TRUE(map->Gather({.positions = queries_}, {.k = 1}).ok());
}

TEST_F(ReplicatedBuilderTest, BothAreCancelled) {
  const auto map = Build();
  doings_[0]->waits = doings_[1]->waits = true;
  const CancelCheck now = [] { return true; };
  EXPECT_EQ(map->Gather({.positions = queries_}, {.k = 1}, now).status().code(),
            absl::StatusCode::kCancelled);
  EXPECT_EQ(builder_->Build(photons_, {}, now).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(doings_[0]->stopped, 2);
  EXPECT_EQ(doings_[1]->stopped, 2);
}

TEST_F(ReplicatedBuilderTest, WorkIsCountedOnAllDevices) {
  EXPECT_EQ(builder_->WorkBytes({}, 100), 600u);
}

TEST(ChooseDeviceTest, SeveralMustBeDifferentGpus) {
  const auto error = [](const std::string& device) {
    return MakeDeviceBuilder({device, {}}).status().ToString();
  };
  EXPECT_NE(error("0,0").find("is named twice; say their indices"), std::string::npos)
      << error("0,0");
  EXPECT_NE(error("0,99").find("device \"99\" is none of those here"), std::string::npos);
  EXPECT_NE(error("0,").find("is named twice"), std::string::npos);
  const std::size_t native = [] {
    const auto devices = ListDevices();
    for (std::size_t i = 0; i < devices.size(); ++i) {
      if (devices[i].platform == kNativePlatform) return i;
    }
    return devices.size();
  }();
  const std::string both = std::to_string(native) + "," + std::to_string(native == 0 ? 1 : 0);
  EXPECT_NE(error(both).find("several devices must be GPUs"), std::string::npos) << error(both);
}

}  // namespace
}  // namespace treelight
