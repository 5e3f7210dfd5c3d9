#include "server/request_turns.h"

#include <atomic>
#include <map>
#include <vector>

#include "gtest/gtest.h"
#include "tests/gated_builder.h"

namespace treelight::server {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""h;

/// Calls by number, of which each keeps its turn until it is taken from it.
class RequestTurnsTest : public ::testing::Test {
 protected:
  void Await(RequestTurns& turns, int call) {
    turns.Await(
        &calls_[call], [this, call] { ended_[call] = true; },
        [this, call](RequestTurns::Turn turn) {
          started_.push_back(call);
          calls_[call] = std::move(turn);
        });
  }
  /// The request of `call` is here, and counted.
  void Finish(RequestTurns& turns, int call) {
    turns.Arrived(&calls_[call]);
    calls_[call] = {};
  }

  std::vector<int> started_;
  std::map<int, std::atomic<bool>> ended_;
  std::map<int, RequestTurns::Turn> calls_;
};

TEST_F(RequestTurnsTest, AsManyAsAllowedStartAndTheOthersOnceTurnsEnd) {
  RequestTurns turns(1h, 2);
  for (int call = 0; call < 6; ++call) Await(turns, call);
  EXPECT_EQ(started_, (std::vector{0, 1}));
  Finish(turns, 1);
  EXPECT_EQ(started_, (std::vector{0, 1, 5}));
  Finish(turns, 0);
  EXPECT_EQ(started_, (std::vector{0, 1, 5, 2}));
  Finish(turns, 2);
  Finish(turns, 5);
  EXPECT_EQ(started_, (std::vector{0, 1, 5, 2, 4, 3}));
  Finish(turns, 4);
  Finish(turns, 3);
  Await(turns, 6);
  Await(turns, 7);
  Await(turns, 8);
  EXPECT_EQ(started_, (std::vector{0, 1, 5, 2, 4, 3, 6, 7}));
  for (const int call : {6, 7, 8}) Finish(turns, call);
}

TEST_F(RequestTurnsTest, TheOldestIsCutOffWhereMostTurnsAreTakenAndAnyAfterThePatience) {
  RequestTurns turns(1h, 4);
  for (int call = 0; call < 3; ++call) {
    ended_[call] = false;
    Await(turns, call);
  }
  ended_[3] = false;
  std::this_thread::sleep_for(RequestTurns::kGrace + 300ms);
  for (const auto& [call, ended] : ended_) EXPECT_FALSE(ended) << call;  // three of four
  Await(turns, 3);
  EXPECT_TRUE(treelight::testing::Eventually([&] { return ended_[0].load(); }));
  EXPECT_FALSE(ended_[1] || ended_[2] || ended_[3]);
  for (int call = 0; call < 4; ++call) Finish(turns, call);

  RequestTurns impatient(50ms, 4);
  ended_[4] = false;
  Await(impatient, 4);
  EXPECT_TRUE(treelight::testing::Eventually([&] { return ended_[4].load(); }));
  Finish(impatient, 4);
}

TEST(AffordableTurnsTest, AnEighthOfTheMemoryAndEightInAnyCase) {
  constexpr std::uint64_t kMessage = 4 << 20;
  EXPECT_EQ(AffordableTurns(std::uint64_t{4} << 30, kMessage), 128u);
  EXPECT_EQ(TurnBytes(std::uint64_t{4} << 30, kMessage), std::uint64_t{512} << 20);
  EXPECT_EQ(AffordableTurns(100 << 20, kMessage), 8u);
  EXPECT_EQ(TurnBytes(100 << 20, kMessage), 3 * kMessage);  // of 12.5 MiB
  EXPECT_EQ(TurnBytes(10 << 20, kMessage), 0u);
}

}  // namespace
}  // namespace treelight::server
