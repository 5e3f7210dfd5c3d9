#include "server/device_queue.h"

#include <utility>

#include "fmt/format.h"

namespace treelight::server {

DeviceQueue::DeviceQueue(std::size_t depth)
    : depth_(depth), worker_([this](const std::stop_token& stop) { Work(stop); }) {}

absl::Status DeviceQueue::Submit(Alive alive, Turn turn) {
  {
    const std::lock_guard lock(mutex_);
    if (jobs_.size() >= depth_) {
      return absl::ResourceExhaustedError(
          fmt::format("device queue: {} requests wait already, the limit is {} (--queue-depth); "
                      "repeat later, or send fewer and larger batches",
                      jobs_.size(), depth_));
    }
    jobs_.push_back({std::move(alive), std::move(turn), std::chrono::steady_clock::now()});
  }
  wake_.notify_one();
  return absl::OkStatus();
}

std::size_t DeviceQueue::waiting() const {
  const std::lock_guard lock(mutex_);
  return jobs_.size();
}

void DeviceQueue::Work(const std::stop_token& stop) {
  while (true) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, stop, [this] { return !jobs_.empty(); });
      if (jobs_.empty()) return;  // asked to stop, and nobody is left to tell
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    const std::chrono::duration<double, std::micro> queued =
        std::chrono::steady_clock::now() - job.submitted;
    const absl::Status turn =
        stop.stop_requested() ? absl::UnavailableError("the server has stopped; repeat elsewhere")
                              : job.alive();
    job.turn(turn, queued.count());
  }
}

}  // namespace treelight::server
