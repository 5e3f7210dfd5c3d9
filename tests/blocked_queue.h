#ifndef TREELIGHT_TESTS_BLOCKED_QUEUE_H_
#define TREELIGHT_TESTS_BLOCKED_QUEUE_H_

#include <chrono>
#include <future>
#include <thread>

#include "gtest/gtest.h"
#include "server/device_queue.h"
#include "tests/gated_builder.h"

namespace treelight::server {

inline absl::Status Wanted() { return absl::OkStatus(); }

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

/// A job of `work` that has run and taken `duration`.
inline void RunOne(DeviceQueue& queue, const Work& work, std::chrono::milliseconds duration) {
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

}  // namespace treelight::server

#endif  // TREELIGHT_TESTS_BLOCKED_QUEUE_H_
