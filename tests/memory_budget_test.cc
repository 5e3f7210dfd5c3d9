#include "server/memory_budget.h"

#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

using std::chrono_literals::operator""ms;

std::uint64_t Held(const MemoryBudget& budget, Holder holder) {
  return budget.usage()[static_cast<std::size_t>(holder)];
}

bool HasRetryInfo(const absl::Status& status) {
  return status.GetPayload("type.googleapis.com/google.rpc.RetryInfo").has_value();
}

TEST(MemoryBudgetTest, TakesUpToTheLimitAndNotAByteMore) {
  MemoryBudget budget(100);
  auto most = budget.Take(Holder::kUploads, 99, "upload", 1ms);
  ASSERT_TRUE(most.ok());
  auto last = budget.Take(Holder::kAnswers, 1, "answer", 1ms);
  ASSERT_TRUE(last.ok());
  EXPECT_FALSE(budget.Take(Holder::kAnswers, 1, "answer", 1ms).ok());
  EXPECT_EQ(Held(budget, Holder::kUploads), 99u);
  EXPECT_EQ(Held(budget, Holder::kAnswers), 1u);
}

TEST(MemoryBudgetTest, ARefusalTellsLimitAskedAndHolders) {
  MemoryBudget budget(100);
  const auto held = budget.Take(Holder::kMaps, 60, "map", 1ms);
  const auto refused = budget.Take(Holder::kUploads, 50, "header.photon_count is 5", 1ms).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(refused.message(),
            "header.photon_count is 5: 50 bytes of the server's memory, the limit is 100 "
            "(--memory-limit), of which 60 are held (uploads 0, messages 0, answers 0, maps 60); "
            "repeat later, or ask for less");
  EXPECT_EQ(RefusedQuota(refused), "memory");
  EXPECT_TRUE(HasRetryInfo(refused));
}

TEST(MemoryBudgetTest, WhatNeverFitsHasNoRetryInfo) {
  MemoryBudget budget(100);
  const auto refused = budget.Take(Holder::kUploads, 101, "upload", 1ms).status();
  EXPECT_NE(refused.message().find("; ask for less"), absl::string_view::npos);
  EXPECT_FALSE(HasRetryInfo(refused));
  // Nor does the largest number wrap around.
  EXPECT_FALSE(budget.Take(Holder::kUploads, ~std::uint64_t{0}, "upload", 1ms).ok());
}

TEST(MemoryBudgetTest, AShareIsGivenBackOnceWhereverItWent) {
  MemoryBudget budget(100);
  {
    auto first = budget.Take(Holder::kUploads, 60, "upload", 1ms);
    MemoryBudget::Share moved = *std::move(first);
    MemoryBudget::Share assigned;
    assigned = std::move(moved);
    auto second = budget.Take(Holder::kAnswers, 40, "answer", 1ms);
    assigned = *std::move(second);  // gives the 60 back
    EXPECT_EQ(Held(budget, Holder::kUploads), 0u);
    EXPECT_EQ(Held(budget, Holder::kAnswers), 40u);
  }
  EXPECT_EQ(Held(budget, Holder::kAnswers), 0u);
}

TEST(MemoryBudgetTest, AShareGrowsOverTheLimitAndThenNobodyTakes) {
  MemoryBudget budget(100);
  auto map = budget.Take(Holder::kMaps, 50, "map", 1ms);
  map->Resize(120);
  EXPECT_EQ(Held(budget, Holder::kMaps), 120u);
  EXPECT_FALSE(budget.Take(Holder::kUploads, 1, "upload", 1ms).ok());
  map->Resize(10);
  EXPECT_TRUE(budget.Take(Holder::kUploads, 90, "upload", 1ms).ok());
}

TEST(MemoryBudgetTest, AShareIsSplitByWhatItIsFor) {
  MemoryBudget budget(100);
  auto whole = budget.Take(Holder::kUploads, 90, "build", 1ms);
  {
    const auto map = whole->Split(Holder::kMaps, 60);
    EXPECT_EQ(Held(budget, Holder::kUploads), 30u);
    EXPECT_EQ(Held(budget, Holder::kMaps), 60u);
    *whole = {};
    EXPECT_EQ(Held(budget, Holder::kUploads), 0u);
    EXPECT_EQ(map.bytes(), 60u);
  }
  EXPECT_EQ(Held(budget, Holder::kMaps), 0u);
}

TEST(MemoryBudgetTest, AShareMayOutliveTheBudget) {
  MemoryBudget::Share share;
  {
    MemoryBudget budget(100);
    share = *budget.Take(Holder::kMaps, 50, "map", 1ms);
  }
  EXPECT_EQ(share.bytes(), 50u);
}

TEST(MemoryBudgetTest, ThreadsNeverHoldMoreThanTheLimitTogether) {
  MemoryBudget budget(10);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 2000; ++i) {
        const auto share = budget.Take(Holder::kUploads, 3, "upload", 1ms);
        EXPECT_LE(Held(budget, Holder::kUploads), 9u);
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(Held(budget, Holder::kUploads), 0u);
}

}  // namespace
}  // namespace treelight::server
