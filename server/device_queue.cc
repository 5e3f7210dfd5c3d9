#include "server/device_queue.h"

#include <algorithm>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
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
    AdvanceVirtualTime();
    const bool full = jobs_.size() >= depth_ && !Broken("queue_depth");
    const auto later = full ? GatherToLeaveFor(ask) : jobs_.end();
    if (full && later == jobs_.end()) {
      return Refuse(Quota::kQueueDepth,
                    fmt::format("device queue: {} requests wait already, the limit is {} "
                                "(--queue-depth); repeat later, or send fewer and larger batches",
                                jobs_.size(), depth_),
                    ToRetryDelay(BacklogUs() / 2));
    }
    if (auto status = CheckTime(ask); !status.ok()) return status;
    if (full) MakeLeave(later);
    jobs_.push_back({.alive = std::move(alive),
                     .turn = std::move(turn),
                     .work = ask.work,
                     .call = ask.call,
                     .submitted = Clock::now(),
                     .arrived_us = virtual_us_,
                     .status = {}});
    if (shares_[ask.call].job_count++ == 0) ++active_calls_;
  }
  wake_.notify_one();
  return absl::OkStatus();
}

absl::Status DeviceQueue::Check(const DeviceAsk& ask) const {
  const std::lock_guard lock(mutex_);
  return CheckTime(ask);
}

absl::Status DeviceQueue::CheckTime(const DeviceAsk& ask) const {
  const bool idle = (jobs_.empty() && !running_) || Broken("deadline");
  if (idle || ask.deadline == std::chrono::system_clock::time_point::max()) return absl::OkStatus();
  const double own_us = estimate_.Microseconds(ask.work);
  const std::vector<double> finish_us = FinishUs(&ask);
  double wait_us = RunningUs();
  std::size_t count = running_ ? 1 : 0;
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    if (finish_us[i] > finish_us.back()) continue;
    wait_us += estimate_.Microseconds(jobs_[i].work);
    ++count;
  }
  const double left_us =
      std::chrono::duration<double, std::micro>(ask.deadline - std::chrono::system_clock::now())
          .count();
  // Of a call that is late already, its own deadline tells.
  if (left_us <= 0 || wait_us + own_us <= left_us) return absl::OkStatus();
  return Refuse(Quota::kDeadline,
                fmt::format("device queue: {} requests before this one take about {:.0f} ms and it "
                            "itself {:.0f} ms, its deadline is in {:.0f} ms; repeat later, or "
                            "allow more time",
                            count, wait_us / 1000, own_us / 1000, left_us / 1000),
                ToRetryDelay(wait_us));
}

/// Lets V run until now: each call with jobs here has had an equal share of the time since.
void DeviceQueue::AdvanceVirtualTime() {
  const Clock::time_point now = Clock::now();
  if (active_calls_ > 0) {
    virtual_us_ += Microseconds(now - advanced_) / static_cast<double>(active_calls_);
  }
  advanced_ = now;
}

/// F of each job that waits, and of `ask` as if it came now.
std::vector<double> DeviceQueue::FinishUs(const DeviceAsk* ask) const {
  std::vector<double> finish_us;
  finish_us.reserve(jobs_.size() + 1);
  std::unordered_map<const void*, double> last_us;  // of the job before, by call
  const auto add = [&](const void* call, double arrived_us, const Work& work) {
    double& last = last_us.try_emplace(call, LastFinishUs(call)).first->second;
    last = std::max(arrived_us, last) + CostUs(work);
    finish_us.push_back(last);
  };
  for (const Job& job : jobs_) add(job.call, job.arrived_us, job.work);
  if (ask != nullptr) add(ask->call, virtual_us_, ask->work);
  return finish_us;
}

/// F of the last job of `call` that ran, where that is still ahead.
double DeviceQueue::LastFinishUs(const void* call) const {
  const auto share = shares_.find(call);
  return share == shares_.end() ? 0 : share->second.finish_us;
}

/// What is not measured yet takes a moment too: jobs of a call keep their order.
double DeviceQueue::CostUs(const Work& work) const {
  return std::max(1.0, estimate_.Microseconds(work));
}

/// Of the gathers of other calls that would be done later than `ask`, the last.
DeviceQueue::Jobs::iterator DeviceQueue::GatherToLeaveFor(const DeviceAsk& ask) {
  const std::vector<double> finish_us = FinishUs(&ask);
  std::size_t last = jobs_.size();  // `ask` itself
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    const bool may_leave = jobs_[i].work.is_gather() && jobs_[i].call != ask.call;
    if (may_leave && finish_us[i] > finish_us[last]) last = i;
  }
  return jobs_.begin() + static_cast<std::ptrdiff_t>(last);
}

/// Takes a job out of the queue; the queue's thread tells it.
void DeviceQueue::MakeLeave(Jobs::iterator job) {
  job->status =
      Refuse(Quota::kQueueDepth,
             fmt::format("device queue: {} requests wait, the limit is {} (--queue-depth), and one "
                         "came that needs less of the device; repeat later, or send smaller "
                         "batches",
                         jobs_.size(), depth_),
             ToRetryDelay(BacklogUs() / 2));
  ForgetJob(job->call);
  left_.push_back(std::move(*job));
  jobs_.erase(job);
}

/// A job of `call` is here no more.
void DeviceQueue::ForgetJob(const void* call) {
  if (--shares_[call].job_count == 0) --active_calls_;
  // What a call has had counts until the others have had as much.
  std::erase_if(shares_, [this](const auto& share) {
    return share.second.job_count == 0 &&
           (active_calls_ == 0 || share.second.finish_us <= virtual_us_);
  });
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
  double us = RunningUs();
  for (const Job& job : jobs_) us += estimate_.Microseconds(job.work);
  return us;
}

/// What the job that runs will take still.
double DeviceQueue::RunningUs() const {
  if (!running_) return 0;
  return std::max(
      0.0, estimate_.Microseconds(running_->work) - Microseconds(Clock::now() - running_->begun));
}

void DeviceQueue::Serve(const std::stop_token& stop) {
  while (true) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, stop, [this] { return !jobs_.empty() || !left_.empty(); });
      if (jobs_.empty() && left_.empty()) return;  // asked to stop, and nobody is left to tell
      job = TakeNext();
    }
    if (job.status.ok()) {
      Run(job, stop);
    } else {
      job.turn(job.status, Microseconds(Clock::now() - job.submitted));
    }
  }
}

/// One that has left, or the one with the smallest F, which runs from now on.
DeviceQueue::Job DeviceQueue::TakeNext() {
  const bool leaves = !left_.empty();
  Jobs& jobs = leaves ? left_ : jobs_;
  std::size_t next = 0;
  if (!leaves) {
    const std::vector<double> finish_us = FinishUs();
    if (!Broken("fair_queue")) {
      next = std::ranges::min_element(finish_us) - finish_us.begin();
    }
    const double start_us = finish_us[next] - CostUs(jobs_[next].work);
    running_ = {.work = jobs_[next].work, .start_us = start_us, .begun = Clock::now()};
    shares_[jobs_[next].call].finish_us = finish_us[next];
  }
  Job job = std::move(jobs[next]);
  jobs.erase(jobs.begin() + static_cast<std::ptrdiff_t>(next));
  return job;
}

void DeviceQueue::Run(Job& job, const std::stop_token& stop) {
  const auto begun = Clock::now();
  const absl::Status turn = stop.stop_requested()
                                ? absl::UnavailableError("the server has stopped; repeat elsewhere")
                            : Broken("cancelled_in_queue") ? absl::OkStatus()
                                                           : job.alive();
  job.turn(turn, Microseconds(begun - job.submitted));
  const std::lock_guard lock(mutex_);
  AdvanceVirtualTime();
  const double took_us = Microseconds(Clock::now() - begun);
  if (turn.ok()) estimate_.Measured(job.work, took_us);
  shares_[job.call].finish_us = running_->start_us + took_us;
  running_.reset();
  ForgetJob(job.call);
}

}  // namespace treelight::server
