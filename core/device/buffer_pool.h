#ifndef TREELIGHT_CORE_DEVICE_BUFFER_POOL_H_
#define TREELIGHT_CORE_DEVICE_BUFFER_POOL_H_

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "core/device/opencl.h"

namespace treelight {

/// Device memory that is kept when it is released, since making a buffer costs a device more than
/// most kernels take. What is taken again may still be in use by commands enqueued before: right on
/// an in-order queue, where they end before the new owner's begin. Safe to call from several
/// threads at once.
class BufferPool : public std::enable_shared_from_this<BufferPool> {
 public:
  /// Of `context`; keeps at most `kept_bytes`.
  BufferPool(cl::Context context, std::uint64_t kept_bytes)
      : context_(std::move(context)), kept_limit_(kept_bytes) {}

  /// At least `bytes` bytes, more by an eighth at most; they come back when the last reference
  /// goes. Contents are undefined. Throws cl::Error, after all that was kept has been released too.
  std::shared_ptr<const cl::Buffer> Take(std::size_t bytes);

 private:
  void Give(std::unique_ptr<const cl::Buffer> buffer, std::size_t bytes);

  const cl::Context context_;
  const std::uint64_t kept_limit_;
  std::mutex mutex_;
  std::uint64_t kept_bytes_ = 0;
  std::map<std::size_t, std::vector<std::unique_ptr<const cl::Buffer>>> kept_;  // by size
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_DEVICE_BUFFER_POOL_H_
