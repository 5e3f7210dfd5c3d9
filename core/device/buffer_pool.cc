#include "core/device/buffer_pool.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace treelight {
namespace {

/// `bytes` rounded up to one of eight sizes between powers of two, so that released memory fits
/// again.
std::size_t RoundUp(std::size_t bytes) {
  const std::size_t step = std::max<std::size_t>(std::bit_floor(bytes) / 8, 256);
  return (bytes + step - 1) / step * step;
}

}  // namespace

std::shared_ptr<const cl::Buffer> BufferPool::Take(std::size_t bytes) {
  std::size_t size = RoundUp(bytes);
  std::unique_ptr<const cl::Buffer> buffer;
  {
    const std::lock_guard lock(mutex_);
    const auto found = kept_.find(size);
    if (found != kept_.end() && !found->second.empty()) {
      buffer = std::move(found->second.back());
      found->second.pop_back();
      kept_bytes_ -= size;
    }
  }
  if (!buffer) {
    try {
      buffer = std::make_unique<cl::Buffer>(context_, CL_MEM_READ_WRITE, size);
    } catch (const cl::Error&) {
      const std::lock_guard lock(mutex_);
      kept_.clear();
      kept_bytes_ = 0;
      size = bytes;
      buffer = std::make_unique<cl::Buffer>(context_, CL_MEM_READ_WRITE, size);
    }
  }
  const cl::Buffer* const raw = buffer.release();
  return {raw, [pool = weak_from_this(), size](const cl::Buffer* given) {
            std::unique_ptr<const cl::Buffer> owned(given);
            if (const auto alive = pool.lock()) alive->Give(std::move(owned), size);
          }};
}

void BufferPool::Give(std::unique_ptr<const cl::Buffer> buffer, std::size_t bytes) {
  const std::lock_guard lock(mutex_);
  if (kept_bytes_ + bytes > kept_limit_) return;
  kept_[bytes].push_back(std::move(buffer));
  kept_bytes_ += bytes;
}

}  // namespace treelight
