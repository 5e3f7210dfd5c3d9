#ifndef TREELIGHT_TESTS_TEST_DEVICE_H_
#define TREELIGHT_TESTS_TEST_DEVICE_H_

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "tests/clouds.h"

namespace treelight {

/// The OpenCL device that the stages are tested on, opened once: $TREELIGHT_TEST_DEVICE, else the
/// first.
const Gpu& TestGpu();

/// A builder on the same device, made once.
Builder& TestBuilder();

/// A buffer of `values` on the test device.
template <typename T>
Buffer<T> Upload(const std::vector<T>& values) {
  return MakeBuffer<T>(TestGpu().memory(), TestGpu().queue(), values);
}

/// Sizes around the edges of work-groups and tiles, and a large prime.
inline const std::vector<std::size_t> kSizes = {0,   1,    2,    3,    255,   256,
                                                257, 2047, 2048, 2049, 100003};

/// The build stages of one cloud up to the split levels, by the references.
struct SortedCloud {
  std::vector<float> positions;
  std::vector<std::uint32_t> ids;
  std::vector<std::uint8_t> levels;
};
SortedCloud SortCloud(const CloudShape& shape, std::size_t count, int code_bits);

/// Its photons in leaf order.
std::vector<LeafPhoton> InLeafOrder(const SortedCloud& cloud);

}  // namespace treelight

#endif  // TREELIGHT_TESTS_TEST_DEVICE_H_
