#include "server/device_queue.h"

#include <atomic>
#include <future>
#include <vector>

#include "gtest/gtest.h"
#include "server/refusal.h"
#include "tests/gated_builder.h"

namespace treelight::server {
namespace {

absl::Status Wanted() { return absl::OkStatus(); }

/// Keeps the queue's thread busy until it is released.
class Blocker {
 public:
  explicit Blocker(DeviceQueue& queue) {
    std::promise<void> begun;
    // The job may outlive this.
    const std::shared_future<void> released = release_.get_future().share();
    EXPECT_TRUE(queue
                    .Submit(Wanted,
                            [&begun, released](const absl::Status&, double) {
                              begun.set_value();
                              released.wait();
                            })
                    .ok());
    begun.get_future().wait();
  }
  void Release() { release_.set_value(); }

 private:
  std::promise<void> release_;
};

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

/// A job of `work` that has run and taken `duration`.
void RunOne(DeviceQueue& queue, const Work& work, std::chrono::milliseconds duration) {
  std::promise<void> done;
  ASSERT_TRUE(queue
                  .Submit(Wanted,
                          [&](const absl::Status&, double) {
                            std::this_thread::sleep_for(duration);
                            done.set_value();
                          },
                          {.work = work})
                  .ok());
  done.get_future().wait();
}

TEST(DeviceQueueTest, AJobThatWouldBeLateIsRefusedByTheTimesOfThoseBefore) {
  using std::chrono_literals::operator""ms;
  DeviceQueue queue(8);
  const Work build = Work::Build(1000), twice = Work::Build(2000);
  const auto in = [](std::chrono::milliseconds time) {
    return std::chrono::system_clock::now() + time;
  };
  RunOne(queue, build, 200ms);  // 0.2 ms a photon
  Blocker blocker(queue);
  EXPECT_TRUE(queue.Check({.work = build, .deadline = in(300ms)}).ok());
  EXPECT_FALSE(queue.Check({.work = build, .deadline = in(150ms)}).ok());  // by its own time
  const auto job = [](const absl::Status&, double) {};
  ASSERT_TRUE(queue.Submit(Wanted, job, {.work = twice}).ok());
  EXPECT_NEAR(static_cast<double>(queue.backlog().count()), 400e3, 50e3);
  const auto refused = queue.Submit(Wanted, job, {.work = build, .deadline = in(500ms)});
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(RefusedQuota(refused), "deadline");
  EXPECT_EQ(queue.waiting(), 1u);
  // Times of builds say nothing of gathers, and a call without a deadline is never late.
  EXPECT_TRUE(queue.Check({.work = Work::Gather(8, 1 << 20), .deadline = in(500ms)}).ok());
  EXPECT_TRUE(queue.Check({.work = Work::Build(1'000'000)}).ok());
  blocker.Release();
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
  std::promise<absl::Status> turn;
  std::promise<double> waited;
  ASSERT_TRUE(queue
                  .Submit([] { return absl::DeadlineExceededError("late"); },
                          [&](const absl::Status& status, double queue_us) {
                            turn.set_value(status);
                            waited.set_value(queue_us);
                          })
                  .ok());
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  blocker.Release();
  EXPECT_EQ(turn.get_future().get(), absl::DeadlineExceededError("late"));
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
