#include "client/retry.h"

#include <algorithm>
#include <random>

#include "client/status.h"

namespace treelight::client {

bool IsBroken(const absl::Status& status) {
  if (absl::IsUnavailable(status)) return true;
  // No text of a server: it says more than the name of a code, and knows nothing of RST_STREAM.
  return (absl::IsCancelled(status) && status.message() == "CANCELLED") ||
         status.message().find("RST_STREAM") != absl::string_view::npos;
}

std::optional<std::chrono::milliseconds> RetryPolicy::NextPause(const absl::Status& status) {
  constexpr int kMostDoublings = 6;
  constexpr std::chrono::milliseconds kShortest{10}, kFirstBreak{20};
  constexpr int kBreaks = 4;
  const auto delay = RetryDelay(status);
  const bool refused = absl::IsResourceExhausted(status) && delay;
  if (!refused && (!IsBroken(status) || break_count_ == kBreaks)) return std::nullopt;
  thread_local std::mt19937 engine{std::random_device{}()};
  const double spread = std::uniform_real_distribution<double>(1, 1.25)(engine);
  const auto base =
      refused ? std::max(*delay, kShortest) * (1 << std::min(refusal_count_++, kMostDoublings))
              : kFirstBreak * (1 << 2 * break_count_++);
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
