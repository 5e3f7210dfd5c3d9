#include "server/device_queue.h"

#include <algorithm>
#include <unordered_set>
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
                     .together = ask.together,
                     .launch = ask.launch,
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
    std::vector<Job> jobs;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, stop, [this] { return !jobs_.empty() || !left_.empty(); });
      if (jobs_.empty() && left_.empty()) return;  // asked to stop, and nobody is left to tell
      jobs = TakeNext();
    }
    if (const Job& job = jobs.front(); job.status.ok()) {
      Run(jobs, stop);
    } else {
      job.turn(job.status, Microseconds(Clock::now() - job.submitted));
    }
  }
}

/// One that has left, or the one with the smallest F and those that go with it, which run from now
/// on.
std::vector<DeviceQueue::Job> DeviceQueue::TakeNext() {
  std::vector<Job> taken;
  if (!left_.empty()) {
    taken.push_back(std::move(left_.front()));
    left_.pop_front();
    return taken;
  }
  const std::vector<double> finish_us = FinishUs();
  const std::size_t next =
      Broken("fair_queue") ? 0 : std::ranges::min_element(finish_us) - finish_us.begin();
  running_ = {.work = {.kind = jobs_[next].work.kind}, .begun = Clock::now()};
  const std::vector<std::size_t> going = GoingWith(next);
  for (const std::size_t i : going) {
    Job& job = jobs_[i];
    job.cost_us = CostUs(job.work);
    shares_[job.call].finish_us = finish_us[i];
    running_->work.items += job.work.items;
    taken.push_back(std::move(job));
  }
  for (auto i = going.rbegin(); i != going.rend(); ++i) {
    jobs_.erase(jobs_.begin() + static_cast<std::ptrdiff_t>(*i));
  }
  return taken;
}

/// The job `next` and those that go with it, in the order in which they came.
std::vector<std::size_t> DeviceQueue::GoingWith(std::size_t next) const {
  constexpr std::uint64_t kMostItems = 1024;
  const Job& first = jobs_[next];
  if (first.together.empty()) return {next};
  std::vector<std::size_t> going;
  std::uint64_t items = first.work.items;
  std::unordered_set<const void*> held;  // calls with a job that stays: later ones stay behind it
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    const Job& job = jobs_[i];
    const bool goes =
        i == next || (job.together == first.together && job.work.kind == first.work.kind &&
                      !held.contains(job.call) && items + job.work.items <= kMostItems);
    if (goes) {
      going.push_back(i);
      if (i != next) items += job.work.items;
    } else {
      held.insert(job.call);
    }
  }
  return going;
}

void DeviceQueue::Run(const std::vector<Job>& jobs, const std::stop_token& stop) {
  const auto begun = Clock::now();
  std::vector<bool> runs(jobs.size());
  std::function<void()> launch;
  Work work{.kind = jobs.front().work.kind};
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const Job& job = jobs[i];
    const absl::Status turn =
        stop.stop_requested() ? absl::UnavailableError("the server has stopped; repeat elsewhere")
        : Broken("cancelled_in_queue") ? absl::OkStatus()
                                       : job.alive();
    runs[i] = turn.ok();
    if (runs[i]) {
      if (!job.together.empty()) launch = job.launch;
      work.items += job.work.items;
    }
    job.turn(turn, Microseconds(begun - job.submitted));
  }
  if (launch) launch();
  const std::lock_guard lock(mutex_);
  AdvanceVirtualTime();
  const double took_us = Microseconds(Clock::now() - begun);
  if (work.items > 0) estimate_.Measured(work, took_us);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const double part =
        jobs.size() == 1 ? 1
        : !runs[i]       ? 0
                   : static_cast<double>(jobs[i].work.items) / static_cast<double>(work.items);
    shares_[jobs[i].call].finish_us += took_us * part - jobs[i].cost_us;
  }
  running_.reset();
  for (const Job& job : jobs) ForgetJob(job.call);
}

}  // namespace treelight::server
