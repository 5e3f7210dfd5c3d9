#ifndef TREELIGHT_CORE_GPU_PACED_LAUNCHES_H_
#define TREELIGHT_CORE_GPU_PACED_LAUNCHES_H_

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>

#include "core/gpu/gpu.h"
#include "core/kernels/types.h"

namespace treelight {

/// How many queries of a batch may be launched at once so that a call that is cancelled stops soon
/// and others get their turn: as many as take about 20 ms. What a query costs is not known before,
/// but batches that ask the same of the same map often come one after the other.
class LaunchPace {
 public:
  /// The part to begin with, at most `largest`; `first` where the last batch asked something else.
  std::size_t Begin(GatherParams params, std::size_t first, std::size_t largest) {
    params.first = params.count = 0;
    if (params.has_radii != 0 || std::memcmp(&params, &asked_, sizeof params) != 0) part_ = first;
    asked_ = params;
    return std::min(part_, largest);
  }

  /// The next part, after one of `count` queries took so long; at most `largest`.
  std::size_t Next(std::size_t count, std::chrono::duration<double> took, std::size_t largest) {
    constexpr std::chrono::duration<double> kPart = std::chrono::milliseconds(20);
    const double factor = std::clamp(kPart / std::max(took, kPart / 1000), 0.25, 4.0);
    const auto next = static_cast<std::size_t>(static_cast<double>(count) * factor);
    // The rest of a batch, a small part, says nothing against larger ones.
    part_ = factor >= 1 ? std::max(part_, next) : next;
    return std::clamp<std::size_t>(part_, 64, largest);
  }

 private:
  GatherParams asked_{};
  std::size_t part_ = 0;
};

/// Queries of one launch at most.
inline std::size_t QueriesPerLaunch(const Gpu& gpu) {
  return std::size_t{1} << (gpu.device->is_cpu() ? 14 : 20);
}

/// Calls `launch(part)`, which enqueues kernels, for consecutive parts of [0, total) of at most
/// `largest` each; `part` is `params` with its first and count. With a `cancelled` each part is
/// waited for and `pace` says how large the next is; without one all parts are enqueued at once.
/// Throws StatusError, CANCELLED, between parts.
template <typename LaunchPart>
void PacedLaunches(const Gpu& gpu, LaunchPace& pace, GatherParams params, std::size_t total,
                   std::size_t largest, const CancelCheck& cancelled, LaunchPart&& launch) {
  using Clock = std::chrono::steady_clock;
  std::size_t part =
      cancelled ? pace.Begin(params, gpu.device->is_cpu() ? 256 : 32768, largest) : largest;
  for (std::size_t first = 0; first < total;) {
    ThrowIfCancelled(cancelled);
    const std::size_t count = std::min(part, total - first);
    const auto begin = Clock::now();
    params.first = static_cast<cl_uint>(first);
    params.count = static_cast<cl_uint>(count);
    launch(params);
    first += count;
    if (!cancelled) continue;
    gpu.queue().finish();
    part = pace.Next(count, Clock::now() - begin, largest);
  }
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_PACED_LAUNCHES_H_
