#ifndef TREELIGHT_CORE_GPU_PACED_LAUNCHES_H_
#define TREELIGHT_CORE_GPU_PACED_LAUNCHES_H_

#include <algorithm>
#include <chrono>
#include <cstddef>

#include "core/gpu/gpu.h"
#include "core/kernels/types.h"

namespace treelight {

/// Calls `launch(part)`, which enqueues kernels, for consecutive parts of [0, total) of at most
/// `largest` each; `part` is `params` with its first and count.
///
/// What one query costs is not known before: with a `cancelled` each part is waited for, and the
/// next is sized to take about 20 ms, so that a call that is cancelled stops soon and others get
/// their turn. Without one all parts are enqueued at once. Throws StatusError, CANCELLED, between
/// parts.
template <typename LaunchPart>
void PacedLaunches(const Gpu& gpu, GatherParams params, std::size_t total, std::size_t largest,
                   const CancelCheck& cancelled, LaunchPart&& launch) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::duration<double> kPart = std::chrono::milliseconds(20);
  std::size_t part =
      cancelled ? std::min<std::size_t>(largest, gpu.device->is_cpu() ? 256 : 32768) : largest;
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
    const std::chrono::duration<double> took = Clock::now() - begin;
    const double factor = std::clamp(kPart / std::max(took, kPart / 1000), 0.25, 4.0);
    part = std::clamp<std::size_t>(static_cast<std::size_t>(static_cast<double>(part) * factor), 64,
                                   largest);
  }
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_PACED_LAUNCHES_H_
