#include "server/device_queue.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "server/refusal.h"
#include "tests/blocked_queue.h"
#include "tests/gated_builder.h"

namespace treelight::server {
namespace {

TEST(DeviceQueueTest, JobsRunOneByOneInTheirOrder) {
  std::vector<int> order;  // written by one thread; read after the queue has ended
  std::atomic<int> running = 0, most = 0;
  {
    DeviceQueue queue(100);
    std::promise<void> done;
    for (int i = 0; i < 100; ++i) {
      const auto status = queue.Submit(Wanted, [&, i](const absl::Status& turn, double) {
        most = std::max<int>(most, ++running);
        EXPECT_TRUE(turn.ok());
        order.push_back(i);
        --running;
        if (i == 99) done.set_value();
      });
      ASSERT_TRUE(status.ok()) << status;
    }
    done.get_future().wait();
  }
  ASSERT_EQ(order.size(), 100u);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(order[i], i);
  EXPECT_EQ(most, 1);
}

TEST(DeviceQueueTest, AFullQueueRefusesAndNamesTheLimit) {
  std::atomic<int> ran = 0;
  {
    DeviceQueue queue(2);
    Blocker blocker(queue);
    const auto job = [&](const absl::Status&, double) { ++ran; };
    EXPECT_TRUE(queue.Submit(Wanted, job).ok());
    EXPECT_TRUE(queue.Submit(Wanted, job).ok());
    const auto refused = queue.Submit(Wanted, job);
    EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
    EXPECT_NE(std::string(refused.message()).find("the limit is 2 (--queue-depth)"),
              std::string::npos);
    EXPECT_EQ(RefusedQuota(refused), "queue");
    EXPECT_EQ(queue.waiting(), 2u);
    blocker.Release();
    EXPECT_TRUE(treelight::testing::Eventually([&] { return ran == 2; }));
  }
  EXPECT_EQ(ran, 2);
}

TEST(DeviceQueueTest, AJobThatWouldBeLateIsRefusedByTheTimesOfThoseBefore) {
  using std::chrono_literals::operator""ms;
  DeviceQueue queue(8);
  const Work build = Work::Build(1000), twice = Work::Build(2000);
  const auto in = [](std::chrono::milliseconds time) {
    return std::chrono::system_clock::now() + time;
  };
  RunOne(queue, build, 200ms);  // 0.2 ms a photon, or more on a busy machine
  Blocker blocker(queue);
  EXPECT_TRUE(queue.Check({.work = build, .deadline = in(60'000ms)}).ok());
  EXPECT_FALSE(queue.Check({.work = build, .deadline = in(150ms)}).ok());  // by its own time
  const auto job = [](const absl::Status&, double) {};
  ASSERT_TRUE(queue.Submit(Wanted, job, {.work = build}).ok());
  const auto build_time = std::chrono::duration_cast<std::chrono::milliseconds>(queue.backlog());
  EXPECT_GE(build_time, 200ms);
  ASSERT_TRUE(queue.Submit(Wanted, job, {.work = twice}).ok());
  EXPECT_NEAR(static_cast<double>(queue.backlog() / 1ms),
              3.0 * static_cast<double>(build_time.count()), 4);
  const auto refused =
      queue.Submit(Wanted, job, {.work = build, .deadline = in(7 * build_time / 2)});
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(RefusedQuota(refused), "deadline");
  EXPECT_EQ(queue.waiting(), 2u);
  // Times of builds say nothing of gathers, and a call without a deadline is never late.
  EXPECT_TRUE(queue.Check({.work = Work::Gather(8, 1 << 20), .deadline = in(60'000ms)}).ok());
  EXPECT_TRUE(queue.Check({.work = Work::Build(1'000'000)}).ok());
  blocker.Release();
}

/// A queue that has measured gathers of k 8 at 20 us a query and builds at 20 us a photon, and
/// whose thread is busy until Finish(). Jobs take as long and note their names, those that must not
/// run with "!" before it.
class SharedQueue {
 public:
  explicit SharedQueue(std::size_t depth) : queue_(depth) {
    using std::chrono_literals::operator""ms;
    // Long enough that what a busy machine adds is little of it.
    RunOne(queue_, Work::Gather(8, 10'000), 200ms);
    RunOne(queue_, Work::Build(10'000), 200ms);
    // The last job's time is taken up when it has ended.
    EXPECT_TRUE(treelight::testing::Eventually([this] { return queue_.backlog().count() == 0; }));
    blocker_.emplace(queue_);
  }

  absl::Status Submit(const std::string& name, int call, const Work& work,
                      std::chrono::system_clock::time_point deadline =
                          std::chrono::system_clock::time_point::max()) {
    return queue_.Submit(
        Wanted,
        [this, name, work](const absl::Status& turn, double) {
          if (!turn.ok()) refusal_ = turn;
          if (turn.ok()) {
            std::this_thread::sleep_for(work.items * std::chrono::microseconds(20));
          }
          order_.push_back((turn.ok() ? "" : "!") + name);
          ++done_;
        },
        {.work = work, .deadline = deadline, .call = &calls_[call]});
  }

  /// Lets `count` jobs run; their names in the order in which they did.
  std::vector<std::string> Finish(int count) {
    blocker_->Release();
    EXPECT_TRUE(treelight::testing::Eventually([&] { return done_ == count; }));
    return order_;
  }

  const absl::Status& refusal() const { return refusal_; }
  std::size_t waiting() const { return queue_.waiting(); }

 private:
  std::array<char, 16> calls_{};
  std::vector<std::string> order_;  // written by the queue's thread, read once done_ says so
  absl::Status refusal_;
  std::atomic<int> done_ = 0;
  DeviceQueue queue_;
  std::optional<Blocker> blocker_;
};

TEST(DeviceQueueTest, ASmallJobPassesTheLargeOnesOfOtherCalls) {
  SharedQueue queue(64);
  std::vector<std::string> expected = {"small"};
  for (int call = 0; call < 10; ++call) {
    const std::string name = "large " + std::to_string(call);
    ASSERT_TRUE(queue.Submit(name, call, Work::Gather(8, 1000)).ok());
    expected.push_back(name);
  }
  ASSERT_TRUE(queue.Submit("small", 10, Work::Gather(8, 10)).ok());
  EXPECT_EQ(queue.Finish(11), expected);
}

TEST(DeviceQueueTest, JobsOfACallKeepTheirOrder) {
  SharedQueue queue(64);
  ASSERT_TRUE(queue.Submit("large", 0, Work::Gather(8, 1000)).ok());
  ASSERT_TRUE(queue.Submit("small", 0, Work::Gather(8, 10)).ok());
  ASSERT_TRUE(queue.Submit("unmeasured", 0, Work::Gather(4096, 10)).ok());
  EXPECT_EQ(queue.Finish(3), (std::vector<std::string>{"large", "small", "unmeasured"}));
}

TEST(DeviceQueueTest, CallsTakeTurnsHoweverMuchEachAsksFor) {
  SharedQueue queue(64);
  const Work work = Work::Gather(8, 1000);
  for (const char* name : {"a0", "a1", "a2", "a3"}) {
    ASSERT_TRUE(queue.Submit(name, 0, work).ok());
  }
  for (const char* name : {"b0", "b1"}) ASSERT_TRUE(queue.Submit(name, 1, work).ok());
  auto order = queue.Finish(6);
  // Of two that are level, either goes first.
  std::sort(order.begin(), order.begin() + 2);
  std::sort(order.begin() + 2, order.begin() + 4);
  EXPECT_EQ(order, (std::vector<std::string>{"a0", "b0", "a1", "b1", "a2", "a3"}));
}

TEST(DeviceQueueTest, ALargeJobRunsOnceTheOthersHaveHadAsMuch) {
  using std::chrono_literals::operator""ms;
  std::atomic<int> before = 0;  // small jobs that ran before the large one
  std::atomic<bool> ran = false;
  std::array<char, 2> calls{};
  DeviceQueue queue(8);
  RunOne(queue, Work::Gather(8, 100), 2ms);
  // A call that always has the next small job here when the last one ends.
  std::function<void(const absl::Status&, double)> small = [&](const absl::Status& turn, double) {
    if (!turn.ok() || ran || ++before > 1000) return;
    EXPECT_TRUE(queue.Submit(Wanted, small, {.work = Work::Gather(8, 100)}).ok());
    std::this_thread::sleep_for(2ms);
  };
  {
    Blocker blocker(queue);
    ASSERT_TRUE(
        queue.Submit(Wanted, small, {.work = Work::Gather(8, 100), .call = calls.data()}).ok());
    ASSERT_TRUE(queue
                    .Submit(Wanted, [&](const absl::Status&, double) { ran = true; },
                            {.work = Work::Gather(8, 5000), .call = &calls[1]})
                    .ok());
    blocker.Release();
  }
  ASSERT_TRUE(treelight::testing::Eventually([&] { return ran.load(); }));
  EXPECT_GT(before, 5);
  EXPECT_LT(before,
            250);  // 100 ms of its own: 50 small ones, or twice as many that are measured late
}

TEST(DeviceQueueTest, OfAFullQueueTheGatherThatWouldBeLastLeavesForASmallerJob) {
  SharedQueue queue(3);
  ASSERT_TRUE(queue.Submit("build", 0, Work::Build(5000)).ok());
  ASSERT_TRUE(queue.Submit("large", 1, Work::Gather(8, 2000)).ok());
  ASSERT_TRUE(queue.Submit("middle", 2, Work::Gather(8, 1000)).ok());
  EXPECT_EQ(RefusedQuota(queue.Submit("larger", 3, Work::Gather(8, 3000))), "queue");
  ASSERT_TRUE(queue.Submit("small", 4, Work::Gather(8, 10)).ok());
  EXPECT_EQ(queue.waiting(), 3u);
  // Builds stay: their photons have come a long way.
  EXPECT_EQ(RefusedQuota(queue.Submit("again", 2, Work::Gather(8, 2000))), "queue");
  const auto order = queue.Finish(4);
  EXPECT_EQ(order, (std::vector<std::string>{"!large", "small", "middle", "build"}));
  EXPECT_EQ(queue.refusal().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(RefusedQuota(queue.refusal()), "queue");
}

TEST(DeviceQueueTest, ADeadlineIsJudgedByTheJobsThatGoFirst) {
  using std::chrono_literals::operator""ms;
  SharedQueue queue(64);
  ASSERT_TRUE(queue.Submit("large", 0, Work::Gather(8, 20'000)).ok());  // 400 ms
  const auto soon = std::chrono::system_clock::now() + 200ms;
  EXPECT_TRUE(queue.Submit("small", 1, Work::Gather(8, 10), soon).ok());
  EXPECT_EQ(RefusedQuota(queue.Submit("same call", 0, Work::Gather(8, 10), soon)), "deadline");
  EXPECT_EQ(queue.Finish(2), (std::vector<std::string>{"small", "large"}));
}

TEST(DeviceQueueTest, AnIdleDeviceTakesEveryJob) {
  using std::chrono_literals::operator""ms;
  DeviceQueue queue(8);
  RunOne(queue, Work::Build(10), 100ms);
  ASSERT_TRUE(treelight::testing::Eventually([&] {
    return queue
        .Check(
            {.work = Work::Build(1'000'000), .deadline = std::chrono::system_clock::now() + 10ms})
        .ok();
  }));
}

TEST(WorkEstimateTest, FollowsTheTimesPerItemOfEachKind) {
  WorkEstimate estimate;
  EXPECT_EQ(estimate.Microseconds(Work::Build(100)), 0);
  estimate.Measured(Work::Build(100), 1000);
  EXPECT_EQ(estimate.Microseconds(Work::Build(50)), 500);
  estimate.Measured(Work::Build(100), 2000);  // a quarter of the way from 10 to 20 us a photon
  EXPECT_EQ(estimate.Microseconds(Work::Build(1)), 12.5);
  for (const std::uint32_t k : {0u, 8u, 9u, 129u}) {
    EXPECT_EQ(estimate.Microseconds(Work::Gather(k, 100)), 0) << k;
  }
  estimate.Measured(Work::Gather(9, 10), 10);
  EXPECT_EQ(estimate.Microseconds(Work::Gather(128, 7)), 7);
  EXPECT_EQ(estimate.Microseconds(Work::Gather(129, 7)), 0);
}

TEST(DeviceQueueTest, AJobNobodyWaitsForIsToldInsteadOfRun) {
  DeviceQueue queue(2);
  Blocker blocker(queue);
  std::promise<std::string>
      turn;  // in words: Abseil's count of a Status's holders is not instrumented
  std::promise<double> waited;
  ASSERT_TRUE(queue
                  .Submit([] { return absl::DeadlineExceededError("late"); },
                          [&](const absl::Status& status, double queue_us) {
                            turn.set_value(status.ToString());
                            waited.set_value(queue_us);
                          })
                  .ok());
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  blocker.Release();
  EXPECT_EQ(turn.get_future().get(), "DEADLINE_EXCEEDED: late");
  EXPECT_GE(waited.get_future().get(), 5000);
}

TEST(DeviceQueueTest, TheEndOfTheQueueTellsThoseWhoWait) {
  absl::Status turn;
  std::promise<void> asked;
  auto queue = std::make_unique<DeviceQueue>(2);
  ASSERT_TRUE(queue
                  ->Submit(Wanted,
                           [&](const absl::Status&, double) {
                             asked.set_value();
                             std::this_thread::sleep_for(std::chrono::milliseconds(50));
                           })
                  .ok());
  asked.get_future().wait();
  ASSERT_TRUE(
      queue->Submit(Wanted, [&](const absl::Status& status, double) { turn = status; }).ok());
  queue.reset();
  EXPECT_EQ(turn.code(), absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace treelight::server
