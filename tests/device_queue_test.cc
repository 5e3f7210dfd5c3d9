#include "server/device_queue.h"

#include <atomic>
#include <future>
#include <vector>

#include "gtest/gtest.h"
#include "tests/gated_builder.h"

namespace treelight::server {
namespace {

absl::Status Wanted() { return absl::OkStatus(); }

/// Keeps the queue's thread busy until it is released.
class Blocker {
 public:
  explicit Blocker(DeviceQueue& queue) {
    std::promise<void> begun;
    EXPECT_TRUE(queue
                    .Submit(Wanted,
                            [&](const absl::Status&, double) {
                              begun.set_value();
                              release_.get_future().wait();
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
    EXPECT_EQ(queue.waiting(), 2u);
    blocker.Release();
    EXPECT_TRUE(treelight::testing::Eventually([&] { return ran == 2; }));
  }
  EXPECT_EQ(ran, 2);
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
