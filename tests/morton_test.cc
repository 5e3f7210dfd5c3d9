#include "core/gpu/morton.h"

#include <random>

#include "core/model/morton_grid.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

template <typename Key>
void CheckCodes(const std::vector<float>& positions, const MortonGrid& grid, int bits_per_axis,
                const std::string& what) {
  const std::size_t count = positions.size() / 3;
  KeyValues<Key> codes(TestGpu().memory(), count);
  ComputeMortonCodes(TestGpu(), Upload(positions), count, Upload<MortonGrid>({grid}), codes);
  const auto keys = codes.keys.Read(TestGpu().queue());
  const auto values = codes.values.Read(TestGpu().queue());
  const auto expected = reference::MortonCodes(positions, grid, bits_per_axis);
  for (std::size_t i = 0; i < count; ++i) {
    ASSERT_EQ(keys[i], expected[i]) << what << " " << i;
    ASSERT_EQ(values[i], i) << what;
  }
}

TEST(MortonTest, KernelsAgreeWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : kSizes) {
      const auto positions = shape.make(size, /*seed=*/7);
      const Box bounds = reference::Bounds(positions);
      CheckCodes<cl_uint>(positions, MakeMortonGrid(bounds, 10), 10, shape.name);
      CheckCodes<cl_ulong>(positions, MakeMortonGrid(bounds, 21), 21, shape.name);
    }
  }
}

TEST(MortonTest, PointsOutsideTheGridAreClamped) {
  const MortonGrid grid = MakeMortonGrid({{0, 0, 0}, {1, 1, 1}}, 10);
  const std::vector<float> positions = {-5, -5, -5, 1, 1, 1, 1e18f, 1e18f, 1e18f, -1e18f, 0.5f, 7};
  CheckCodes<cl_uint>(positions, grid, 10, "outside");
  const auto codes = reference::MortonCodes(positions, grid, 10);
  EXPECT_EQ(codes[0], 0u);
  EXPECT_EQ(codes[1], (1u << 30) - 1);
  EXPECT_EQ(codes[2], (1u << 30) - 1);
}

TEST(MortonTest, XLiesInTheHighestBit) {
  const MortonGrid grid = MakeMortonGrid({{0, 0, 0}, {1, 1, 1}}, 10);
  EXPECT_EQ(reference::MortonCodes({0.75f, 0, 0}, grid, 10)[0], 0b100100u << 24);
  EXPECT_EQ(reference::MortonCodes({0, 0.5f, 0}, grid, 10)[0], 0b010u << 27);
}

TEST(MortonTest, FreshPointsAgreeWithReference) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-1000, 1000);
  std::vector<float> positions;
  for (int i = 0; i < 3 * 5000; ++i) positions.push_back(coordinate(random));
  const Box bounds = reference::Bounds(positions);
  CheckCodes<cl_uint>(positions, MakeMortonGrid(bounds, 10), 10, "fresh");
  CheckCodes<cl_ulong>(positions, MakeMortonGrid(bounds, 21), 21, "fresh");
}

}  // namespace
}  // namespace treelight
