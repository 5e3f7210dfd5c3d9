// What gathers cost on a device, and what a choice makes of it.

#include "core/gather_costs.h"

#include <cmath>
#include <utility>
#include <vector>

#include "core/builder.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/clouds.h"
#include "tests/counting_builder.h"
#include "tests/forwarding_gatherer.h"
#include "tests/merged_maps.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr GatherKind kKinds[] = {GatherKind::kNearest, GatherKind::kWithin, GatherKind::kWhole};

TEST(GatherCostsTest, BetweenEntriesByAPowerOfThePhotons) {
  GatherCosts costs;
  for (std::size_t i = 0; i < GatherCosts::kEntries; ++i) {
    const double photons = GatherCosts::kFewest << i;
    costs.entries[i] = {.batch_us = 100 * std::sqrt(photons), .query_us = 0.5 * photons};
  }
  for (const double photons : {8.0, 9.0, 16.0, 50.0, 500.0, 1023.0, 1024.0}) {
    EXPECT_NEAR(costs.At(photons).query_us, 0.5 * photons, 1e-9 * photons);
    EXPECT_NEAR(costs.At(photons).batch_us, 100 * std::sqrt(photons), 1e-6);
  }
  // Beyond them.
  EXPECT_NEAR(costs.At(4000).query_us, 2000, 1e-6);
  EXPECT_NEAR(costs.At(4000).batch_us, 3200, 1e-6);
  for (const double photons : {0.0, 1.0, 7.9}) EXPECT_EQ(costs.At(photons).query_us, 4);
  EXPECT_EQ((GatherCosts::Cost{.batch_us = 3, .query_us = 0.5}.Of(10)), 8);
}

TEST(MeasureGatherCostsTest, EveryKindOnEachDevice) {
  const auto cpu = MakeCpuBuilder();
  for (Builder* const builder : {cpu.get(), &TestBuilder()}) {
    for (const GatherKind kind : kKinds) {
      SCOPED_TRACE(::testing::Message() << static_cast<int>(kind));
      const auto costs = MeasureGatherCosts(*builder, kind);
      ASSERT_TRUE(costs.ok()) << costs.status();
      for (const GatherCosts::Cost& cost : costs->entries) {
        EXPECT_GE(cost.batch_us, 0);
        EXPECT_GT(cost.Of(20'000), 1);
        EXPECT_LT(cost.Of(20'000), 1e8);
      }
      // 128 times the photons: more by far than a busy machine adds.
      EXPECT_GT(costs->entries.back().Of(20'000), 1.5 * costs->entries.front().Of(20'000));
    }
  }
}

TEST(GatherCostsOfDeviceTest, MeasuresEachKindOnce) {
  CountingBuilder builder;
  GatherCostsOfDevice costs(builder);
  for (const GatherKind kind : kKinds) {
    EXPECT_GT(costs.WorkBytes(kind), 0u);
    EXPECT_EQ(costs.Find(kind, [] { return true; }).status().code(), absl::StatusCode::kCancelled);
    EXPECT_GT(costs.WorkBytes(kind), 0u);
    const int before = builder.builds;
    const auto first = costs.Find(kind), second = costs.Find(kind);
    ASSERT_TRUE(first.ok() && second.ok());
    EXPECT_EQ(builder.builds, before + 1);
    EXPECT_EQ(costs.WorkBytes(kind), 0u);
    EXPECT_EQ(first->At(50).query_us, second->At(50).query_us);
  }
}

/// Costs of a kind: of a batch, of a query in ns for each photon.
CostsOf Costs(double batch_us, double photon_ns, double whole_ns) {
  return [=](GatherKind kind) -> absl::StatusOr<GatherCosts> {
    GatherCosts costs;
    for (std::size_t i = 0; i < GatherCosts::kEntries; ++i) {
      const double ns = kind == GatherKind::kWhole ? whole_ns : photon_ns;
      costs.entries[i] = {.batch_us = batch_us,
                          .query_us = ns * (GatherCosts::kFewest << i) / 1000};
    }
    return costs;
  };
}

class ChoiceByCosts : public ::testing::Test {
 protected:
  const Photons photons_ = MakeCloud(CloudNamed("surfaces"), 20'011, /*seed=*/5);
  const std::vector<float> positions_ = MakeQueries(photons_, 8000, /*seed=*/6);
  const GatherQueries queries_{.positions = positions_};
  const std::unique_ptr<Builder> builder_ = MakeCpuBuilder();
  MergedMaps maps_{*builder_, photons_};
  GatherOptions Asks(std::uint32_t k, DensityKernel kernel = DensityKernel::kEpanechnikov) {
    GatherOptions options{.k = k,
                          .outputs = kOutputCount | kOutputDensity,
                          .kernel = kernel,
                          .approximation = {.max_relative_error = 0.2f}};
    if (k == 0) options.radius = MedianRadius(maps_.map(), queries_, 400);
    return options;
  }
};

TEST_F(ChoiceByCosts, WhereLaunchesCostMoreThanPhotonsNothingIsSampled) {
  for (const std::uint32_t k : {0u, 400u}) {
    // 8000 queries of 400 photons: 3.2 ms of an endless batch.
    EXPECT_FALSE(maps_.Choose(queries_, Asks(k), Costs(10, 1, 9)).exact());
    const MergeChoice slow = maps_.Choose(queries_, Asks(k), Costs(3000, 1, 9));
    EXPECT_EQ(slow.reason, ExactReason::kFewQueries);
    EXPECT_EQ(slow.sampled, 0u);
    EXPECT_EQ(slow.times.kernel_us, 0);  // not even counted
    // Where photons are free, fewer of them gain nothing.
    EXPECT_EQ(maps_.Choose(queries_, Asks(k), Costs(10, 0, 9)).reason, ExactReason::kFewPhotons);
  }
  const MergeChoice whole = maps_.Choose(queries_, Asks(0), Costs(3000, 9, 1));
  EXPECT_EQ(whole.reason, ExactReason::kFewQueries);
  EXPECT_TRUE(whole.whole);
  EXPECT_EQ(whole.times.kernel_us, 0);
}

TEST_F(ChoiceByCosts, SubtreesAreAddedUpWholeWhereThatIsCheapest) {
  const CostsOf whole_is_free = Costs(1, 100, 0.01);
  const GatherOptions options = Asks(0);
  const MergeChoice choice = maps_.Choose(queries_, options, whole_is_free);
  EXPECT_TRUE(choice.exact());
  EXPECT_TRUE(choice.whole);
  MergeChoice whole = choice, each;
  const auto answer = *GatherExactly(maps_.map(), whole, queries_, options);
  const auto exact = *GatherExactly(maps_.map(), each, queries_, options);
  EXPECT_EQ(answer.error_bounds.size(), queries_.size());
  EXPECT_TRUE(exact.error_bounds.empty());
  EXPECT_EQ(answer.counts, exact.counts);
  for (std::size_t i = 0; i < exact.densities.size(); ++i) {
    ASSERT_NEAR(answer.densities[i], exact.densities[i], 1e-5 * exact.densities[i]) << i;
  }
  // Merged photons are cheaper than both.
  EXPECT_FALSE(maps_.Choose(queries_, options, Costs(1, 1, 0.9)).whole);
  EXPECT_FALSE(maps_.Choose(queries_, options, Costs(1, 1, 0.9)).exact());
  // Moments know neither normals nor the cone, and have no k nearest.
  EXPECT_FALSE(maps_.Choose(queries_, Asks(400), whole_is_free).whole);
  EXPECT_FALSE(maps_.Choose(queries_, Asks(0, DensityKernel::kCone), whole_is_free).whole);
  std::vector<float> normals(positions_.size(), 0);
  for (std::size_t i = 0; i < normals.size(); i += 3) normals[i] = 1;
  EXPECT_FALSE(
      maps_.Choose({.positions = positions_, .normals = normals}, options, whole_is_free).whole);
}

/// A map that refuses to add up subtrees whole, for want of room for their moments, say.
class PhotonByPhoton : public treelight::testing::ForwardingGatherer {
 public:
  PhotonByPhoton(std::unique_ptr<Gatherer> map, absl::Status refusal)
      : ForwardingGatherer(std::move(map)), refusal_(std::move(refusal)) {}
  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    if (options.approximation.weight_tolerance == 0) {
      return ForwardingGatherer::Gather(queries, options, cancelled);
    }
    ++refused;
    return refusal_;
  }
  mutable int refused = 0;

 private:
  const absl::Status refusal_;
};

TEST_F(ChoiceByCosts, WithoutRoomForMomentsPhotonByPhotonFromThenOn) {
  const PhotonByPhoton map(*builder_->Build(photons_, {}, {}),
                           absl::ResourceExhaustedError("room"));
  const GatherOptions options = Asks(0);
  MergeChoice choice, each;
  choice.whole = true;
  const auto exact = *GatherExactly(maps_.map(), each, queries_, options);
  for (int batch = 0; batch < 2; ++batch) {
    const auto answer = GatherExactly(map, choice, queries_, options);
    ASSERT_TRUE(answer.ok()) << answer.status();
    EXPECT_FALSE(choice.whole);
    EXPECT_EQ(map.refused, 1);
    EXPECT_TRUE(answer->error_bounds.empty());
    EXPECT_EQ(answer->counts, exact.counts);
    EXPECT_EQ(answer->densities, exact.densities);
  }
}

TEST_F(ChoiceByCosts, ASampleThatFindsNoRoomForMomentsIsReckonedPhotonByPhoton) {
  const PhotonByPhoton map(*builder_->Build(photons_, {}, {}),
                           absl::ResourceExhaustedError("room"));
  const auto merged = [this](const FewerPhotons& fewer) { return maps_.Fewer(fewer); };
  // Merged photons gain by what all cost one by one, not by what they cost whole.
  const MergeChoice whole = maps_.Choose(queries_, Asks(0), Costs(1, 100, 20));
  EXPECT_TRUE(whole.exact());
  EXPECT_TRUE(whole.whole);
  EXPECT_GT(whole.sampled, 0u);
  const auto choice = ChooseMerge(map, merged, Costs(1, 100, 20), queries_, Asks(0));
  ASSERT_TRUE(choice.ok()) << choice.status();
  EXPECT_EQ(map.refused, 1);
  EXPECT_FALSE(choice->exact());
  EXPECT_EQ(choice->fewer, maps_.Choose(queries_, Asks(0), Costs(1, 100, 100)).fewer);
}

TEST_F(ChoiceByCosts, OtherErrorsOfAnExactGatherPassThrough) {
  const PhotonByPhoton map(*builder_->Build(photons_, {}, {}), absl::InternalError("broken"));
  MergeChoice choice, each;
  choice.whole = true;
  EXPECT_EQ(GatherExactly(map, choice, queries_, Asks(0)).status(), absl::InternalError("broken"));
  EXPECT_EQ(map.refused, 1);
  EXPECT_TRUE(choice.whole);
  const auto stop = [] { return true; };
  for (MergeChoice* const stopped : {&choice, &each}) {
    EXPECT_TRUE(
        absl::IsCancelled(GatherExactly(maps_.map(), *stopped, queries_, Asks(0), stop).status()));
  }
}

TEST_F(ChoiceByCosts, WithoutCostsItIsExact) {
  const auto none = [](GatherKind) -> absl::StatusOr<GatherCosts> {
    return absl::ResourceExhaustedError("none");
  };
  EXPECT_EQ(maps_.Choose(queries_, Asks(400), none).reason, ExactReason::kNoMemory);
  const auto broken = [](GatherKind) -> absl::StatusOr<GatherCosts> {
    return absl::InternalError("broken");
  };
  const auto merged = [this](const FewerPhotons& fewer) { return maps_.Fewer(fewer); };
  EXPECT_TRUE(
      absl::IsInternal(ChooseMerge(maps_.map(), merged, broken, queries_, Asks(400)).status()));
}

}  // namespace
}  // namespace treelight
