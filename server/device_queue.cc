#include "server/device_queue.h"

#include <algorithm>
#include <utility>

#include "fmt/format.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

using std::chrono_literals::operator""ms;

/// `us` as a time to wait before a repeat.
std::chrono::milliseconds ToRetryDelay(double us) {
  constexpr std::chrono::milliseconds kShortest = 100ms, kLongest = 30'000ms;
  return std::clamp(std::chrono::milliseconds(static_cast<std::int64_t>(us / 1000)), kShortest,
                    kLongest);
}

double Microseconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

}  // namespace

DeviceQueue::DeviceQueue(std::size_t depth)
    : depth_(depth), worker_([this](const std::stop_token& stop) { Serve(stop); }) {}

absl::Status DeviceQueue::Submit(Alive alive, Turn turn, const DeviceAsk& ask) {
  {
    const std::lock_guard lock(mutex_);
    if (jobs_.size() >= depth_) {
      return Refuse(Quota::kQueueDepth,
                    fmt::format("device queue: {} requests wait already, the limit is {} "
                                "(--queue-depth); repeat later, or send fewer and larger batches",
                                jobs_.size(), depth_),
                    ToRetryDelay(BacklogUs() / 2));
    }
    if (auto status = CheckTime(ask); !status.ok()) return status;
    jobs_.push_back({std::move(alive), std::move(turn), ask.work, Clock::now()});
  }
  wake_.notify_one();
  return absl::OkStatus();
}

absl::Status DeviceQueue::Check(const DeviceAsk& ask) const {
  const std::lock_guard lock(mutex_);
  return CheckTime(ask);
}

absl::Status DeviceQueue::CheckTime(const DeviceAsk& ask) const {
  const bool idle = jobs_.empty() && !running_;
  if (idle || ask.deadline == std::chrono::system_clock::time_point::max()) return absl::OkStatus();
  const double wait_us = BacklogUs(), own_us = estimate_.Microseconds(ask.work);
  const double left_us =
      std::chrono::duration<double, std::micro>(ask.deadline - std::chrono::system_clock::now())
          .count();
  // Of a call that is late already, its own deadline tells.
  if (left_us <= 0 || wait_us + own_us <= left_us) return absl::OkStatus();
  return Refuse(
      Quota::kDeadline,
      fmt::format("device queue: {} requests before this one take about {:.0f} ms and it "
                  "itself {:.0f} ms, its deadline is in {:.0f} ms; repeat later, or "
                  "allow more time",
                  jobs_.size() + (running_ ? 1 : 0), wait_us / 1000, own_us / 1000, left_us / 1000),
      ToRetryDelay(wait_us));
}

std::size_t DeviceQueue::waiting() const {
  const std::lock_guard lock(mutex_);
  return jobs_.size();
}

std::chrono::microseconds DeviceQueue::backlog() const {
  const std::lock_guard lock(mutex_);
  return std::chrono::microseconds(static_cast<std::int64_t>(BacklogUs()));
}

std::chrono::milliseconds DeviceQueue::RetryDelay() const {
  const std::lock_guard lock(mutex_);
  return ToRetryDelay(BacklogUs());
}

double DeviceQueue::BacklogUs() const {
  double us = 0;
  for (const Job& job : jobs_) us += estimate_.Microseconds(job.work);
  if (running_) {
    us += std::max(
        0.0, estimate_.Microseconds(running_->work) - Microseconds(Clock::now() - running_->begun));
  }
  return us;
}

void DeviceQueue::Serve(const std::stop_token& stop) {
  while (true) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, stop, [this] { return !jobs_.empty(); });
      if (jobs_.empty()) return;  // asked to stop, and nobody is left to tell
      job = std::move(jobs_.front());
      jobs_.pop_front();
      running_ = {job.work, Clock::now()};
    }
    Run(job, stop);
  }
}

void DeviceQueue::Run(Job& job, const std::stop_token& stop) {
  const auto begun = Clock::now();
  const absl::Status turn = stop.stop_requested()
                                ? absl::UnavailableError("the server has stopped; repeat elsewhere")
                                : job.alive();
  job.turn(turn, Microseconds(begun - job.submitted));
  const std::lock_guard lock(mutex_);
  running_.reset();
  if (turn.ok()) estimate_.Measured(job.work, Microseconds(Clock::now() - begun));
}

}  // namespace treelight::server
