// Merged photons through the service: what answers and the log tell, and what a map holds of them.

#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "client/photon_map_client.h"
#include "gmock/gmock.h"
#include "nlohmann/json.hpp"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

constexpr std::chrono::seconds kTimeout{60};  // a deadlock fails instead of hanging
constexpr std::size_t kQueries = 2003;

class MergedServiceTest : public treelight::testing::ServerTest {
 protected:
  void StartWith(std::uint64_t part_bytes) {
    options_.limits.max_part_bytes = part_bytes;
    Start(MakeCpuBuilder());
    client_ = std::make_unique<PhotonMapClient>(server_->InProcessChannel(), kTimeout);
    ASSERT_TRUE(client_->BuildPhotonMap("map", photons_).ok());
  }

  GatherAnswer Gather(const GatherOptions& options) {
    const auto answer = client_->Gather({.name = "map"}, {.positions = positions_}, options);
    EXPECT_TRUE(answer.ok()) << answer.status();
    return answer.ok() ? *answer : GatherAnswer();
  }

  std::uint64_t DeviceBytes() { return (*client_->ListPhotonMaps())[0].device_bytes(); }

  /// What is logged of the last gather; ends the server.
  nlohmann::json LastGather() {
    nlohmann::json last;
    for (const std::string& line : EndAndReadLog()) {
      const auto json = nlohmann::json::parse(line);
      if (json.contains("merge_report")) last = json;
    }
    EXPECT_FALSE(last.is_null());
    return last;
  }

  /// RMS over queries of |density / exact density - 1|, of the sum of the channels.
  static double ErrorOf(const GatherResult& answer, const GatherResult& exact) {
    double sum = 0;
    for (std::size_t i = 0; i < kQueries; ++i) {
      const auto total = [i](const GatherResult& result) {
        return std::accumulate(&result.densities[3 * i], &result.densities[3 * i] + 3, 0.0);
      };
      sum += std::pow(total(answer) / total(exact) - 1, 2);
    }
    return std::sqrt(sum / kQueries);
  }

  const std::uint32_t seed_ = std::random_device{}();
  const Photons photons_ = treelight::testing::MakePhotons(20011, seed_);
  const std::vector<float> positions_ = treelight::testing::MakePoints(kQueries, seed_ + 1);
  std::unique_ptr<PhotonMapClient> client_;
};

TEST_F(MergedServiceTest, ABatchKeepsTheErrorThatItAsksFor) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartWith(1 << 20);
  const std::uint64_t held = DeviceBytes();
  GatherOptions options{.k = 300, .outputs = kOutputCount | kOutputRadius | kOutputDensity};
  const GatherResult exact = Expected(photons_, positions_, options);
  options.approximation.max_relative_error = 0.2f;
  const GatherAnswer answer = Gather(options);
  const v1::MergeReport& report = answer.merge_report;
  ASSERT_GT(report.merged_photons(), 0u);
  EXPECT_EQ(report.exact_reason(), v1::EXACT_REASON_UNSPECIFIED);
  EXPECT_GE(report.sampled_queries(), 128u);
  EXPECT_GT(report.measured_error(), 0);
  EXPECT_LE(report.error_limit(), 0.2f);
  EXPECT_LE(ErrorOf(answer.result, exact), 0.2);
  EXPECT_GT(answer.errors.inexact_count, kQueries / 2);
  EXPECT_TRUE(std::isinf(answer.errors.largest_bound));
  EXPECT_EQ(answer.result.counts.size(), kQueries);
  // The merged maps stay, and are counted.
  EXPECT_GT(DeviceBytes(), held + held / 50);
  const auto line = LastGather();
  EXPECT_NEAR(line["approximation"]["max_relative_error"], 0.2, 1e-6);
  EXPECT_EQ(line["merge_report"]["merged_photons"], report.merged_photons());
  EXPECT_EQ(line["merge_report"]["sampled_queries"], report.sampled_queries());
}

TEST_F(MergedServiceTest, SlicesOfAStreamHaveOneChoice) {
  StartWith(1500);
  std::vector<v1::GatherResponse> parts;
  v1::GatherRequest asks =
      treelight::testing::MakeBatch("map", positions_, {.k = 300, .outputs = kOutputDensity});
  asks.mutable_approximation()->set_max_relative_error(0.2f);
  ASSERT_TRUE(treelight::testing::Stream(*stub_, std::vector{asks}, parts).ok());
  ASSERT_GT(parts.size(), 10u);
  std::string densities;
  for (const v1::GatherResponse& part : parts) {
    EXPECT_EQ(part.merge_report().SerializeAsString(), parts[0].merge_report().SerializeAsString());
    EXPECT_EQ(part.approximate(), part.merge_report().merged_photons() > 0);
    densities += part.densities();
  }
  ASSERT_GT(parts[0].merge_report().merged_photons(), 0u);
  // The same bits as in one message.
  v1::GatherResponse whole;
  grpc::ClientContext context;
  ASSERT_TRUE(stub_->Gather(&context, asks, &whole).ok());
  EXPECT_EQ(whole.densities(), densities);
}

TEST_F(MergedServiceTest, WhatIsExactSaysSoAndIs) {
  StartWith(1 << 20);
  GatherOptions options{.k = 60, .outputs = kOutputDensity};
  const GatherAnswer exact = Gather(options);
  EXPECT_FALSE(exact.merge_report.merged_photons() > 0 || exact.merge_report.exact_reason() != 0);
  options.approximation.max_relative_error = 0.03f;
  const GatherAnswer answer = Gather(options);
  EXPECT_EQ(answer.result.densities, exact.result.densities);
  EXPECT_EQ(answer.errors.inexact_count, 0u);
  EXPECT_EQ(answer.errors.largest_bound, 0);
  EXPECT_EQ(answer.merge_report.merged_photons(), 0u);
  EXPECT_NE(answer.merge_report.exact_reason(), v1::EXACT_REASON_UNSPECIFIED);  // by costs here
  options.k = 10;
  EXPECT_EQ(Gather(options).merge_report.exact_reason(), v1::EXACT_REASON_FEW_PHOTONS);
  const auto line = LastGather();
  EXPECT_EQ(line["merge_report"]["exact_reason"], "EXACT_REASON_FEW_PHOTONS");
}

TEST_F(MergedServiceTest, AGroupSizeMayBeAskedFor) {
  StartWith(1 << 20);
  GatherOptions options{.k = 300, .outputs = kOutputDensity};
  const GatherResult exact = Expected(photons_, positions_, options);
  double last = 1;
  for (const std::uint32_t size : {16u, 4u}) {
    options.approximation.merged_photons = size;
    const GatherAnswer answer = Gather(options);
    EXPECT_EQ(answer.merge_report.merged_photons(), size);
    const double error = ErrorOf(answer.result, exact);
    EXPECT_LT(error, last);
    EXPECT_NEAR(answer.merge_report.measured_error(), error, 0.5 * error);
    last = error;
  }
}

TEST_F(MergedServiceTest, ARandomSubsetIsKeptAsMergedPhotonsAreAndErrsMore) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartWith(1 << 20);
  GatherOptions options{.k = 400, .outputs = kOutputDensity};
  const GatherResult exact = Expected(photons_, positions_, options);
  options.approximation.merged_photons = 8;
  const GatherAnswer merged = Gather(options);
  const std::uint64_t held = DeviceBytes();
  options.approximation = {.thinned_photons = 8};
  const GatherAnswer answer = Gather(options);
  EXPECT_EQ(answer.merge_report.thinned_photons(), 8u);
  EXPECT_EQ(answer.merge_report.merged_photons(), 0u);
  EXPECT_EQ(answer.merge_report.exact_reason(), v1::EXACT_REASON_UNSPECIFIED);
  EXPECT_GT(answer.errors.inexact_count, kQueries / 2);
  const double error = ErrorOf(answer.result, exact);
  EXPECT_NEAR(answer.merge_report.measured_error(), error, 0.5 * error);
  EXPECT_GT(error, ErrorOf(merged.result, exact));
  // A map of its own, made once: the same subset answers again.
  const std::uint64_t with_subset = DeviceBytes();
  EXPECT_GT(with_subset, held + held / 50);
  EXPECT_EQ(Gather(options).result.densities, answer.result.densities);
  EXPECT_EQ(DeviceBytes(), with_subset);
  const auto line = LastGather();
  EXPECT_EQ(line["approximation"]["thinned_photons"], 8);
  EXPECT_EQ(line["merge_report"]["thinned_photons"], 8);
}

TEST_F(MergedServiceTest, WithoutMemoryBatchesAreExact) {
  // Enough for the map alone.
  options_.devices.resize(1);
  options_.devices[0].type = "cpu";
  options_.devices[0].memory_bytes = options_.devices[0].max_buffer_bytes =
      (*MakeCpuBuilder()->Build(photons_, {}))->report().device_bytes + 1000;
  StartWith(1 << 20);
  const GatherOptions options{
      .k = 300, .outputs = kOutputDensity, .approximation = {.merged_photons = 8}};
  const auto before = Gather({.k = 300, .outputs = kOutputDensity});
  const auto answer = Gather(options);
  EXPECT_EQ(answer.merge_report.exact_reason(), v1::EXACT_REASON_NO_MEMORY);
  EXPECT_EQ(answer.result.densities, before.result.densities);
}

TEST_F(MergedServiceTest, WhatIsNotPossibleIsRefused) {
  StartWith(1 << 20);
  const auto refused = [&](const GatherOptions& options) {
    return client_->Gather({.name = "map"}, {.positions = positions_}, options).status().ToString();
  };
  EXPECT_THAT(refused({.k = 5,
                       .outputs = kOutputDensity | kOutputNeighbors,
                       .approximation = {.max_relative_error = 0.1f}}),
              ::testing::HasSubstr("INVALID_ARGUMENT: approximation.max_relative_error is 0.1, but "
                                   "outputs is 12: it is for DENSITY"));
  EXPECT_THAT(
      refused({.k = 5, .outputs = kOutputDensity, .approximation = {.merged_photons = 5}}),
      ::testing::HasSubstr("INVALID_ARGUMENT: approximation.merged_photons is 5, it must be"));
}

}  // namespace
}  // namespace treelight::client
