#include "core/gpu/split_levels.h"

#include <algorithm>

#include "core/model/morton_grid.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

template <typename Key>
void CheckLevels(const std::vector<std::uint64_t>& codes, int code_bits) {
  const std::size_t boundary_count = codes.empty() ? 0 : codes.size() - 1;
  const Buffer<cl_uchar> levels(TestGpu().memory(), boundary_count);
  ComputeSplitLevels(TestGpu(), Upload(std::vector<Key>(codes.begin(), codes.end())), codes.size(),
                     levels);
  ASSERT_EQ(levels.Read(TestGpu().queue()), reference::SplitLevels(codes, code_bits))
      << codes.size();
}

TEST(SplitLevelsTest, KernelsAgreeWithReference) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : kSizes) {
      const auto positions = shape.make(size, /*seed=*/7);
      const Box bounds = reference::Bounds(positions);
      auto codes = reference::MortonCodes(positions, MakeMortonGrid(bounds, 10), 10);
      std::sort(codes.begin(), codes.end());
      CheckLevels<cl_uint>(codes, 30);
      codes = reference::MortonCodes(positions, MakeMortonGrid(bounds, 21), 21);
      std::sort(codes.begin(), codes.end());
      CheckLevels<cl_ulong>(codes, 63);
    }
  }
}

TEST(SplitLevelsTest, EqualCodesAreTied) {
  EXPECT_EQ(reference::SplitLevels({5, 5, 7}, 30), (std::vector<std::uint8_t>{kLevelTied, 28}));
  CheckLevels<cl_uint>({5, 5, 7}, 30);
}

}  // namespace
}  // namespace treelight
