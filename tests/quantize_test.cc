#include "core/model/quantize.h"

#include <cmath>
#include <random>

#include "gtest/gtest.h"

namespace treelight {
namespace {

TEST(QuantizeTest, AWorkedExample) {
  // Steps of 1 along x, 1/2 along y, and one place along z.
  const std::vector<float> positions = {0, 10,   7,     65535, 10 + 65535 / 2.0f, 7, 2.4f, 10.3f,
                                        7, 2.6f, 10.2f, 7};
  const QuantizedPositions quantized = Quantize(positions);
  EXPECT_EQ(quantized.box, (Box{{0, 10, 7}, {65535, 32777.5f, 7}}));
  EXPECT_EQ(quantized.offsets,
            (std::vector<std::uint16_t>{0, 0, 0, 65535, 65535, 0, 2, 1, 0, 3, 0, 0}));
  std::vector<float> back;
  AppendPositions(quantized.box, quantized.offsets, back);
  EXPECT_EQ(back, (std::vector<float>{0, 10, 7, 65535, 32777.5f, 7, 2, 10.5f, 7, 3, 10, 7}));
  EXPECT_NEAR(LargestMove(quantized.box), std::hypot(0.5, 0.25), 0.006);
  EXPECT_GE(LargestMove(quantized.box), std::hypot(0.5, 0.25));
}

TEST(QuantizeTest, NoPositionMovesFartherThanIsTold) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (const float size : {1e-42f, 1e-30f, 1e-3f, 1.0f, 1e6f, 1e18f}) {
    for (const float offset : {0.0f, size, 1e6f, -1e17f}) {
      if (std::fabs(offset) + size > 1.001e18f) continue;
      std::vector<float> positions;
      for (int i = 0; i < 3000; ++i) {
        const float axis_size = i % 3 == 2 ? 0 : size;  // flat along z
        positions.push_back(std::min(offset + axis_size * unit(random), 1e18f));
      }
      const QuantizedPositions quantized = Quantize(positions);
      std::vector<float> back = {5};  // stays
      AppendPositions(quantized.box, quantized.offsets, back);
      ASSERT_EQ(back.size(), positions.size() + 1);
      EXPECT_EQ(back[0], 5);
      const double most = LargestMove(quantized.box);
      double farthest = 0;
      for (std::size_t i = 0; i < positions.size(); i += 3) {
        double square = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const float is = back[1 + i + axis];
          ASSERT_GE(is, Component(quantized.box.min, static_cast<int>(axis)));
          ASSERT_LE(is, Component(quantized.box.max, static_cast<int>(axis)));
          square += std::pow(double{is} - positions[i + axis], 2);
        }
        farthest = std::max(farthest, std::sqrt(square));
      }
      EXPECT_LE(farthest, most) << size << " at " << offset;
      // No looser than it has to be, where steps are longer than float's.
      if (offset == 0 && size > 1e-38f) {
        EXPECT_GT(farthest, 0.8 * most) << size;
      }
    }
  }
}

TEST(QuantizeTest, WhatIsAtOnePlaceStaysThere) {
  const std::vector<float> positions = {0.1f, -3e17f, 1e-40f, 0.1f, -3e17f, 1e-40f};
  const QuantizedPositions quantized = Quantize(positions);
  std::vector<float> back;
  AppendPositions(quantized.box, quantized.offsets, back);
  EXPECT_EQ(back, positions);
  EXPECT_EQ(LargestMove(quantized.box), 0);
}

}  // namespace
}  // namespace treelight
