#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "server/device_queue.h"
#include "tests/blocked_queue.h"
#include "tests/gated_builder.h"

// Jobs that go to the device together.
namespace treelight::server {
namespace {

/// A queue whose jobs with a key note which of them went together; its thread is busy until
/// Finish().
class TogetherQueue {
 public:
  TogetherQueue() : queue_(64) { blocker_.emplace(queue_); }

  /// A job without a key does its work in its turn.
  void Submit(int job, int call, const std::string& key, std::uint64_t items = 4,
              const absl::Status& wanted = absl::OkStatus()) {
    const auto status = queue_.Submit(
        [wanted] { return wanted; },
        [this, job, key](const absl::Status& turn, double) {
          if (turn.ok()) going_.push_back(job);
          if (turn.ok() && key.empty()) Launch();
          ++done_;
        },
        {.work = Work::Gather(8, items), .call = &calls_[call], .together = key, .launch = [this] {
           Launch();
         }});
    ASSERT_TRUE(status.ok()) << status;
    ++submitted_;
  }

  /// Lets the jobs run; which went together, in the order in which they did.
  std::vector<std::vector<int>> Finish() {
    blocker_->Release();
    EXPECT_TRUE(treelight::testing::Eventually([&] { return done_ == submitted_; }));
    EXPECT_TRUE(treelight::testing::Eventually([&] { return queue_.backlog().count() == 0; }));
    blocker_.emplace(queue_);  // the last launch has ended
    blocker_->Release();
    return launches_;
  }

 private:
  void Launch() { launches_.push_back(std::exchange(going_, {})); }

  std::array<char, 64> calls_{};
  int submitted_ = 0;
  std::atomic<int> done_ = 0;
  std::vector<int> going_;  // both by the queue's thread, read when it is done
  std::vector<std::vector<int>> launches_;
  DeviceQueue queue_;
  std::optional<Blocker> blocker_;
};

using Launches = std::vector<std::vector<int>>;

TEST(DeviceQueueTest, JobsWithOneKeyGoTogether) {
  TogetherQueue queue;
  queue.Submit(0, 0, "a");
  queue.Submit(1, 1, "b");
  queue.Submit(2, 2, "a");
  queue.Submit(3, 3, "");
  queue.Submit(4, 4, "");
  queue.Submit(5, 5, "a");
  queue.Submit(6, 0, "a");  // of the call of the first
  EXPECT_EQ(queue.Finish(), (Launches{{0, 2, 5, 6}, {1}, {3}, {4}}));
}

TEST(DeviceQueueTest, NoJobPassesAnEarlierOneOfItsCallToGoWithOthers) {
  TogetherQueue queue;
  queue.Submit(0, 0, "a");
  queue.Submit(1, 1, "");
  queue.Submit(2, 1, "a");
  queue.Submit(3, 2, "a");
  EXPECT_EQ(queue.Finish(), (Launches{{0, 3}, {1}, {2}}));
}

TEST(DeviceQueueTest, ALaunchHasALimitedNumberOfItems) {
  TogetherQueue queue;
  for (int i = 0; i < 20; ++i) queue.Submit(i, i, "a", 64);
  const Launches launches = queue.Finish();
  ASSERT_EQ(launches.size(), 2u);
  EXPECT_EQ(launches[0].size(), 16u);
  EXPECT_EQ(launches[1].size(), 4u);
}

TEST(DeviceQueueTest, WhatIsNotWantedDoesNotGoWithOthers) {
  TogetherQueue queue;
  queue.Submit(0, 0, "a", 4, absl::CancelledError("gone"));
  queue.Submit(1, 1, "a");
  queue.Submit(2, 2, "a", 4, absl::CancelledError("gone"));
  queue.Submit(3, 3, "b", 4, absl::CancelledError("gone"));
  EXPECT_EQ(queue.Finish(), (Launches{{1}}));
}

TEST(DeviceQueueTest, EachOfALaunchHasHadItsShareOfTheTime) {
  using std::chrono_literals::operator""ms;
  std::array<char, 3> calls{};
  std::vector<int> order;
  std::atomic<int> done = 0;
  DeviceQueue queue(64);
  RunOne(queue, Work::Gather(8, 100), 2ms);
  Blocker blocker(queue);
  const auto submit = [&](int call, std::uint64_t items, const std::string& key) {
    const auto note = [&, call](const absl::Status&, double) {
      order.push_back(call);
      ++done;
    };
    EXPECT_TRUE(queue
                    .Submit(Wanted, note,
                            {.work = Work::Gather(8, items),
                             .call = &calls[call],
                             .together = key,
                             .launch = [] { std::this_thread::sleep_for(100ms); }})
                    .ok());
  };
  // 100 ms, of which the first call has 90 and the second 10.
  submit(0, 900, "a");
  submit(1, 100, "a");
  // While a third call keeps the device busy, the one that has had less is next.
  submit(2, 100, "b");
  submit(0, 100, "");
  submit(1, 100, "");
  blocker.Release();
  ASSERT_TRUE(treelight::testing::Eventually([&] { return done == 5; }));
  const auto second = [&](int call) {
    return std::find(std::find(order.begin(), order.end(), call) + 1, order.end(), call);
  };
  EXPECT_LT(second(1), second(0));
}

}  // namespace
}  // namespace treelight::server
