#include "core/gpu/bounds.h"

#include <cstring>
#include <string>

#include "core/model/morton_grid.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

void ExpectGrid(const Buffer<MortonGrid>& grid, const MortonGrid& expected,
                const std::string& what) {
  const MortonGrid actual = grid.ReadAt(TestGpu().queue(), 0);
  EXPECT_EQ(std::memcmp(&actual, &expected, sizeof actual), 0) << what;
}

TEST(BoundsTest, KernelAgreesWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : kSizes) {
      const auto positions = shape.make(size, /*seed=*/7);
      const DeviceBounds bounds = ComputeBounds(TestGpu(), Upload(positions), size);
      const Box box = bounds.ReadBox(TestGpu()), expected = reference::Bounds(positions);
      ASSERT_EQ(std::memcmp(&box, &expected, sizeof box), 0) << shape.name << " " << size;
      ExpectGrid(bounds.grid_30, MakeMortonGrid(expected, 10), shape.name);
      ExpectGrid(bounds.grid_63, MakeMortonGrid(expected, 21), shape.name);
    }
  }
}

TEST(BoundsTest, NoPointsHaveAnEmptyBox) {
  EXPECT_EQ(ComputeBounds(TestGpu(), Upload<float>({}), 0).ReadBox(TestGpu()), Box{});
}

}  // namespace
}  // namespace treelight
