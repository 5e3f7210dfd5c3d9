#include "client/retry.h"

#include <algorithm>
#include <random>

#include "client/status.h"

namespace treelight::client {

std::optional<std::chrono::milliseconds> RetryPolicy::NextPause(const absl::Status& status) {
  constexpr int kMostDoublings = 6;
  constexpr std::chrono::milliseconds kShortest{10};
  const auto delay = RetryDelay(status);
  if (!absl::IsResourceExhausted(status) || !delay) return std::nullopt;
  thread_local std::mt19937 engine{std::random_device{}()};
  const double spread = std::uniform_real_distribution<double>(1, 1.25)(engine);
  const auto base = std::max(*delay, kShortest) * (1 << std::min(refusal_count_++, kMostDoublings));
  const std::chrono::milliseconds pause(static_cast<std::int64_t>(spread * base.count()));
  if (pause > left_) return std::nullopt;
  if (deadline_ != std::chrono::system_clock::time_point::max() &&
      pause >= deadline_ - std::chrono::system_clock::now()) {
    return std::nullopt;
  }
  left_ -= pause;
  return pause;
}

}  // namespace treelight::client
