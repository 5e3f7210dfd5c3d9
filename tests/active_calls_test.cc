#include "server/active_calls.h"

#include <atomic>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

using std::chrono_literals::operator""ms;

constexpr std::size_t kLimit = 100;

/// A time that no test lives to see.
std::chrono::system_clock::time_point Never() {
  return std::chrono::system_clock::now() + std::chrono::hours(1);
}

TEST(ActiveCallsTest, WithNoCallTheWaitIsOver) {
  ActiveCalls calls(kLimit);
  EXPECT_EQ(calls.WaitForNone(Never()), 0u);
}

TEST(ActiveCallsTest, OneMoreThanTheLimitIsRefusedUntilOneLeaves) {
  ActiveCalls calls(2);
  ASSERT_TRUE(calls.Enter().ok());
  ASSERT_TRUE(calls.Enter().ok());
  const absl::Status refused = calls.Enter();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(RefusedQuota(refused), "calls");
  EXPECT_EQ(refused.message(),
            "2 calls are open already, the limit is 2 (--max-calls); repeat later, or send more in "
            "one call");
  calls.Leave();  // the one that was refused
  calls.Leave();
  EXPECT_TRUE(calls.Enter().ok());
}

TEST(ActiveCallsTest, TheWaitEndsAtTheDeadlineAndCountsWhatIsOpen) {
  ActiveCalls calls(kLimit);
  ASSERT_TRUE(calls.Enter().ok());
  ASSERT_TRUE(calls.Enter().ok());
  calls.Leave();
  EXPECT_EQ(calls.WaitForNone(std::chrono::system_clock::now() + 10ms), 1u);
}

TEST(ActiveCallsTest, ARefusedCallCountsUntilItLeaves) {
  ActiveCalls calls(kLimit);
  calls.Close();
  EXPECT_EQ(calls.Enter().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(calls.WaitForNone(std::chrono::system_clock::now()), 1u);
  calls.Leave();
  EXPECT_EQ(calls.WaitForNone(Never()), 0u);
}

TEST(ActiveCallsTest, ADrainAmongManyCallsLosesNone) {
  ActiveCalls calls(kLimit);
  std::atomic<int> admitted = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (bool open = true; open;) {
        open = calls.Enter().ok();
        admitted += open ? 1 : 0;
        calls.Leave();
      }
    });
  }
  while (admitted < 100) std::this_thread::yield();
  calls.Close();
  threads.clear();
  EXPECT_EQ(calls.WaitForNone(Never()), 0u);
}

}  // namespace
}  // namespace treelight::server
