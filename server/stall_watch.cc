#include "server/stall_watch.h"

#include <algorithm>
#include <utility>

#include "server/break_switch.h"

namespace treelight::server {

StallWatch::StallWatch(std::chrono::milliseconds patience, std::size_t most,
                       std::chrono::milliseconds grace)
    : patience_(patience),
      most_(most),
      grace_(grace),
      thread_([this](const std::stop_token& stop) { Watch(stop); }) {}

void StallWatch::Wait(const void* call, std::function<void()> end) {
  const std::lock_guard lock(mutex_);
  waiting_.insert_or_assign(call, Waiting{Clock::now(), std::move(end)});
  if (waiting_.size() > most_) wake_.notify_all();
}

void StallWatch::Arrived(const void* call) {
  std::unique_lock lock(mutex_);
  waiting_.erase(call);
  // gRPC may run what follows from a cancellation inside of it.
  if (std::this_thread::get_id() == thread_.get_id()) return;
  wake_.wait(lock, [&] { return ending_ != call; });
}

void StallWatch::Watch(const std::stop_token& stop) {
  using std::chrono_literals::operator""ms;
  // Each is noticed at most this much late.
  const std::chrono::milliseconds pause = std::clamp(patience_ / 8, 5ms, 1000ms);
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const bool crowded = waiting_.size() > most_;
    wake_.wait_for(lock, stop, crowded ? grace_ / 4 : pause,
                   [&] { return !crowded && waiting_.size() > most_; });
    while (const auto late = TakeLate()) {
      ending_ = late->first;
      lock.unlock();
      late->second();
      lock.lock();
      ending_ = nullptr;
      wake_.notify_all();
    }
  }
}

std::optional<std::pair<const void*, std::function<void()>>> StallWatch::TakeLate() {
  const auto now = Clock::now();
  const auto late =
      std::ranges::min_element(waiting_, {}, [](const auto& entry) { return entry.second.since; });
  if (late == waiting_.end() || Broken("stall")) return std::nullopt;
  const auto allowed = waiting_.size() > most_ ? std::min(grace_, patience_) : patience_;
  if (now - late->second.since < allowed) return std::nullopt;
  std::pair taken(late->first, std::move(late->second.end));
  waiting_.erase(late);
  return taken;
}

}  // namespace treelight::server
