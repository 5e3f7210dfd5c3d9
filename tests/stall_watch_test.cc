#include "server/stall_watch.h"

#include <array>
#include <atomic>

#include "gtest/gtest.h"
#include "tests/gated_builder.h"

namespace treelight::server {
namespace {

using std::chrono_literals::operator""ms;

TEST(StallWatchTest, EndsWhoStandsStillOnceAndNotBefore) {
  StallWatch watch(50ms);
  std::atomic<int> ended = 0;
  const auto begun = std::chrono::steady_clock::now();
  std::atomic<std::chrono::steady_clock::duration> after{};
  watch.Wait(&ended, [&] {
    after = std::chrono::steady_clock::now() - begun;
    ++ended;
  });
  ASSERT_TRUE(treelight::testing::Eventually([&] { return ended > 0; }));
  EXPECT_GE(after.load(), 50ms);
  std::this_thread::sleep_for(100ms);
  EXPECT_EQ(ended, 1);
}

TEST(StallWatchTest, OfTooManyTheOldestIsEnded) {
  StallWatch watch(std::chrono::hours(1), /*most=*/2);
  std::array<std::atomic<int>, 4> ended = {};
  const auto begun = std::chrono::steady_clock::now();
  for (auto& call : ended) {
    watch.Wait(&call, [&call] { ++call; });
    std::this_thread::sleep_for(1ms);
  }
  ASSERT_TRUE(treelight::testing::Eventually([&] { return ended[0] + ended[1] == 2; }));
  EXPECT_GE(std::chrono::steady_clock::now() - begun, StallWatch::kGrace);
  std::this_thread::sleep_for(2 * StallWatch::kGrace);
  EXPECT_EQ(ended[2] + ended[3], 0);
}

TEST(StallWatchTest, WhoMovesIsNotEnded) {
  StallWatch watch(500ms);
  std::atomic<int> ended = 0;
  for (int i = 0; i < 20; ++i) {
    watch.Wait(&ended, [&] { ++ended; });
    std::this_thread::sleep_for(40ms);  // 800 ms in all
    watch.Arrived(&ended);
  }
  EXPECT_EQ(ended, 0);
}

TEST(StallWatchTest, ArrivedWaitsForAnEndThatRuns) {
  StallWatch watch(10ms);
  std::atomic<bool> running = false, done = false;
  int call = 0;
  watch.Wait(&call, [&] {
    running = true;
    std::this_thread::sleep_for(100ms);
    done = true;
  });
  ASSERT_TRUE(treelight::testing::Eventually([&] { return running.load(); }));
  watch.Arrived(&call);
  EXPECT_TRUE(done);
}

TEST(StallWatchTest, AnEndMayFinishItsCallOnTheSameThread) {
  StallWatch watch(10ms);
  std::atomic<bool> done = false;
  int call = 0;
  watch.Wait(&call, [&] {
    watch.Arrived(&call);
    done = true;
  });
  EXPECT_TRUE(treelight::testing::Eventually([&] { return done.load(); }));
}

}  // namespace
}  // namespace treelight::server
