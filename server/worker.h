#ifndef TREELIGHT_SERVER_WORKER_H_
#define TREELIGHT_SERVER_WORKER_H_

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>

namespace treelight::server {

/// A thread that runs jobs one at a time in the order in which they come: what waits for a disk,
/// away from gRPC's threads and the device's. Its end runs what is left. Safe to call from several
/// threads at once.
class Worker {
 public:
  Worker() : thread_([this](const std::stop_token& stop) { Serve(stop); }) {}

  void Submit(std::function<void()> job) {
    {
      const std::lock_guard lock(mutex_);
      jobs_.push_back(std::move(job));
    }
    wake_.notify_one();
  }

 private:
  void Serve(const std::stop_token& stop) {
    while (true) {
      std::function<void()> job;
      {
        std::unique_lock lock(mutex_);
        wake_.wait(lock, stop, [this] { return !jobs_.empty(); });
        if (jobs_.empty()) return;
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
      job();
    }
  }

  std::mutex mutex_;
  std::condition_variable_any wake_;        // with mutex_: jobs_ is not empty
  std::deque<std::function<void()>> jobs_;  // guarded by mutex_
  std::jthread thread_;                     // last: it joins before the rest goes
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_WORKER_H_
