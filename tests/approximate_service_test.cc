// Approximate answers through the service: what they tell of themselves, and what is logged.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "client/photon_map_client.h"
#include "gmock/gmock.h"
#include "nlohmann/json.hpp"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

constexpr std::chrono::seconds kTimeout{60};  // a deadlock fails instead of hanging
constexpr std::size_t kQueries = 1009;

class ApproximateServiceTest : public treelight::testing::ServerTest {
 protected:
  /// A server that answers batches of at most 400 queries, in parts of few.
  void SetUp() override {
    options_.limits.max_queries = 400;
    options_.limits.max_part_bytes = 2000;
    Start(MakeCpuBuilder());
    client_ = std::make_unique<PhotonMapClient>(server_->InProcessChannel(), kTimeout);
    ASSERT_TRUE(client_->BuildPhotonMap("map", photons_).ok());
  }

  GatherAnswer Gather(const GatherOptions& options) {
    const auto answer = client_->Gather({.name = "map"}, {.positions = positions_}, options);
    EXPECT_TRUE(answer.ok()) << answer.status();
    return answer.ok() ? *answer : GatherAnswer();
  }

  const Photons photons_ = treelight::testing::MakePhotons(5003, /*seed=*/1);
  const std::vector<float> positions_ = treelight::testing::MakePoints(kQueries, /*seed=*/2);
  std::unique_ptr<PhotonMapClient> client_;
};

TEST_F(ApproximateServiceTest, AnswersTellTheirErrors) {
  const GatherOptions options{.k = 50,
                              .outputs = kOutputRadius | kOutputErrorBound,
                              .approximation = {.epsilon = 0.5f, .max_leaves = 9}};
  const GatherAnswer answer = Gather(options);
  ASSERT_EQ(answer.result.error_bounds.size(), kQueries);
  std::size_t inexact = 0;
  float largest = 0;
  for (const float bound : answer.result.error_bounds) {
    inexact += bound > 0 ? 1 : 0;
    largest = std::max(largest, bound);
  }
  EXPECT_GT(inexact, kQueries / 10);
  EXPECT_EQ(answer.errors.inexact_count, inexact);
  EXPECT_EQ(answer.errors.largest_bound, largest);
  const auto exact = Gather({.k = 50, .outputs = kOutputRadius});
  for (std::size_t i = 0; i < kQueries; ++i) {
    const float bound = answer.result.error_bounds[i];
    if (std::isfinite(bound)) {
      EXPECT_LE(answer.result.radii[i], exact.result.radii[i] * (1 + bound) * (1 + 1e-6f)) << i;
    }
  }
}

TEST_F(ApproximateServiceTest, TheSummaryComesWithoutTheBounds) {
  const GatherOptions options{
      .k = 8, .outputs = kOutputRadius, .approximation = {.epsilon = 0.25f}};
  const GatherAnswer answer = Gather(options);
  EXPECT_TRUE(answer.result.error_bounds.empty());
  EXPECT_GT(answer.errors.inexact_count, 0u);
  EXPECT_GT(answer.errors.largest_bound, 0);
  EXPECT_LE(answer.errors.largest_bound, 0.25f + 1e-6f);
  const GatherAnswer exact = Gather({.k = 8, .outputs = kOutputRadius});
  EXPECT_EQ(exact.errors.inexact_count, 0u);
  EXPECT_EQ(exact.errors.largest_bound, 0);
}

TEST_F(ApproximateServiceTest, AnApproximateAnswerSaysSo) {
  auto request =
      treelight::testing::MakeBatch("map", {0.5f, 0.5f, 0.5f}, {.k = 5, .outputs = kOutputRadius});
  v1::GatherResponse exact, approximate;
  grpc::ClientContext first, second;
  ASSERT_TRUE(stub_->Gather(&first, request, &exact).ok());
  EXPECT_FALSE(exact.approximate());
  request.mutable_approximation()->set_max_leaves(1);
  ASSERT_TRUE(stub_->Gather(&second, request, &approximate).ok());
  EXPECT_TRUE(approximate.approximate());
  EXPECT_TRUE(approximate.error_bounds().empty());
  const auto lines = EndAndReadLog();
  EXPECT_FALSE(nlohmann::json::parse(lines[lines.size() - 2]).contains("approximation"));
  EXPECT_EQ(nlohmann::json::parse(lines.back())["approximation"]["max_leaves"], 1);
}

TEST_F(ApproximateServiceTest, WhatIsNotPossibleIsRefused) {
  const auto refused = [&](const GatherOptions& options) {
    return client_->Gather({.name = "map"}, {.positions = positions_}, options).status().ToString();
  };
  EXPECT_THAT(refused({.k = 0, .radius = 1, .approximation = {.epsilon = 1}}),
              ::testing::HasSubstr("INVALID_ARGUMENT: approximation.epsilon is 1, but k is 0"));
  EXPECT_THAT(refused({.k = 1, .outputs = kOutputErrorBound}),
              ::testing::HasSubstr("INVALID_ARGUMENT: outputs: ERROR_BOUND is for approximate"));
}

}  // namespace
}  // namespace treelight::client
