#include "core/gpu/bounds.h"

#include <cstring>

#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

TEST(BoundsTest, KernelAgreesWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : kSizes) {
      const auto positions = shape.make(size, /*seed=*/7);
      const Box box = ComputeBounds(TestGpu(), Upload(positions), size);
      const Box expected = reference::Bounds(positions);
      ASSERT_EQ(std::memcmp(&box, &expected, sizeof box), 0) << shape.name << " " << size;
    }
  }
}

TEST(BoundsTest, NoPointsHaveAnEmptyBox) {
  EXPECT_EQ(ComputeBounds(TestGpu(), Upload<float>({}), 0), Box{});
}

}  // namespace
}  // namespace treelight
