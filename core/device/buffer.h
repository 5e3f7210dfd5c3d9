#ifndef TREELIGHT_CORE_DEVICE_BUFFER_H_
#define TREELIGHT_CORE_DEVICE_BUFFER_H_

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "core/device/buffer_pool.h"
#include "core/device/opencl.h"
#include "core/huge_pages.h"

namespace treelight {

/// `size()` elements of T in global device memory. A copy is a second reference. Throws cl::Error.
/// Kernels take `get()`; of an empty buffer that is a one-element dummy, since OpenCL has no empty
/// buffers.
template <typename T>
class Buffer {
 public:
  Buffer() = default;

  /// Contents are undefined.
  Buffer(BufferPool& pool, std::size_t size)
      : memory_(pool.Take((size > 0 ? size : 1) * sizeof(T))), size_(size) {}

  std::size_t size() const { return size_; }
  std::size_t bytes() const { return size_ * sizeof(T); }
  const cl::Buffer& get() const { return *memory_; }

  /// Copies `values` to the front of the buffer; waits for `queue`.
  void Write(const cl::CommandQueue& queue, std::span<const T> values) const {
    if (!values.empty())
      queue.enqueueWriteBuffer(*memory_, CL_TRUE, 0, values.size_bytes(), values.data());
  }

  /// Copies the first `count` elements, or those from `first` on, to the host; waits for `queue`.
  std::vector<T> Read(const cl::CommandQueue& queue, std::size_t count,
                      std::size_t first = 0) const {
    std::vector<T> values;
    ReserveHuge(values, count);
    values.resize(count);
    if (count > 0) {
      queue.enqueueReadBuffer(*memory_, CL_TRUE, first * sizeof(T), count * sizeof(T),
                              values.data());
    }
    return values;
  }
  std::vector<T> Read(const cl::CommandQueue& queue) const { return Read(queue, size_); }

  /// The element `index`; waits for `queue`.
  T ReadAt(const cl::CommandQueue& queue, std::size_t index) const {
    T value;
    queue.enqueueReadBuffer(*memory_, CL_TRUE, index * sizeof(T), sizeof(T), &value);
    return value;
  }

  /// Sets every element to `value`; does not wait.
  void Fill(const cl::CommandQueue& queue, T value) const {
    if (size_ > 0) queue.enqueueFillBuffer(*memory_, value, 0, bytes());
  }

 private:
  std::shared_ptr<const cl::Buffer> memory_;
  std::size_t size_ = 0;
};

/// A buffer that holds `values`.
template <typename T>
Buffer<T> MakeBuffer(BufferPool& pool, const cl::CommandQueue& queue, std::span<const T> values) {
  Buffer<T> buffer(pool, values.size());
  buffer.Write(queue, values);
  return buffer;
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_DEVICE_BUFFER_H_
