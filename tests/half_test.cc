#include "core/model/half.h"

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "gtest/gtest.h"

namespace treelight {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// What the bits of a binary16 are worth, by its definition.
double WorthOf(std::uint16_t half) {
  const int exponent = half >> 10 & 31, digits = half & 1023;
  const double sign = (half & 0x8000) != 0 ? -1 : 1;
  if (exponent == 31) return digits == 0 ? sign * kInfinity : std::nan("");
  return sign *
         (exponent == 0 ? std::ldexp(digits, -24) : std::ldexp(1024 + digits, exponent - 25));
}

std::vector<float> FromHalves(const std::vector<std::uint16_t>& halves, float scale) {
  std::vector<float> numbers;
  AppendFromHalves(halves, scale, numbers);
  return numbers;
}

/// The halves of `numbers` at scale 1, which one more number, of [2^14, 2^15), makes it.
std::vector<std::uint16_t> AtScaleOne(std::vector<float> numbers) {
  numbers.push_back(0x1p14f);
  Halves halves = ToHalves(numbers);
  EXPECT_EQ(halves.scale, 1);
  halves.numbers.pop_back();
  return halves.numbers;
}

TEST(HalfTest, AllHalvesAreReadAsTheirDefinitionSays) {
  std::vector<std::uint16_t> all(65536);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint16_t>(i);
  for (const float scale : {1.0f, 0x1p-126f, 0x1p100f}) {
    const auto numbers = FromHalves(all, scale);
    for (std::size_t i = 0; i < all.size(); ++i) {
      const auto expected = static_cast<float>(WorthOf(all[i]) * scale);
      if (std::isnan(expected)) {
        ASSERT_TRUE(std::isnan(numbers[i])) << i;
      } else {
        ASSERT_EQ(numbers[i], expected) << i;
        ASSERT_EQ(std::signbit(numbers[i]), i >= 32768) << i;
      }
    }
  }
}

TEST(HalfTest, AllHalvesThatAScaleLeavesComeBackAsTheyAre) {
  constexpr std::uint16_t kTooLarge = 0x7800, kInfinite = 0x7c00;  // 2^15
  std::vector<std::uint16_t> halves;
  for (std::uint32_t i = 0; i < 65536; ++i) {
    const std::uint32_t magnitude = i & 0x7fff;
    if (magnitude < kTooLarge || magnitude == kInfinite) {
      halves.push_back(static_cast<std::uint16_t>(i));
    }
  }
  EXPECT_EQ(AtScaleOne(FromHalves(halves, 1)), halves);
}

TEST(HalfTest, BetweenTwoHalvesItIsTheNearerAndTheEvenOneInTheMiddle) {
  std::vector<float> numbers;
  std::vector<std::uint16_t> expected;
  for (std::uint16_t half = 0; half < 0x7800 - 1; ++half) {
    const auto above = static_cast<std::uint16_t>(half + 1);
    const auto middle = static_cast<float>((WorthOf(half) + WorthOf(above)) / 2);
    ASSERT_EQ(middle, (WorthOf(half) + WorthOf(above)) / 2);
    const std::uint16_t even = half % 2 == 0 ? half : above;
    for (const std::uint16_t sign : {0, 0x8000}) {
      const float s = sign == 0 ? 1 : -1;
      numbers.insert(numbers.end(), {s * std::nextafter(middle, 0.0f), s * middle,
                                     s * std::nextafter(middle, kInfinity)});
      for (const std::uint16_t nearest : {half, even, above}) {
        expected.push_back(static_cast<std::uint16_t>(nearest | sign));
      }
    }
  }
  EXPECT_EQ(AtScaleOne(numbers), expected);
}

TEST(HalfTest, RoundsAsTheCompilerDoes) {
  std::mt19937 random(1);
  std::vector<float> numbers;
  while (numbers.size() < 200'000) {
    const auto number = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    if (std::fabs(number) < 0x1p15f) numbers.push_back(number);
  }
  std::vector<std::uint16_t> expected;
  for (const float number : numbers) {
    expected.push_back(std::bit_cast<std::uint16_t>(static_cast<_Float16>(number)));
  }
  EXPECT_EQ(AtScaleOne(numbers), expected);
}

TEST(HalfTest, NumbersOfAnySizeAreAsNearAsPromised) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> digits(1, 2), sign(-1, 1);
  for (int largest = -149; largest <= 127; ++largest) {
    std::vector<float> numbers = {std::ldexp(1.99f, largest), 0, -0.0f, kInfinity, -kInfinity};
    for (int below = 0; below < 60; ++below) {
      numbers.push_back(std::copysign(std::ldexp(digits(random), largest - below), sign(random)));
    }
    const Halves halves = ToHalves(numbers);
    const auto back = FromHalves(halves.numbers, halves.scale);
    std::size_t small = 0;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const double number = numbers[i];
      if (std::isinf(number)) {
        ASSERT_EQ(back[i], number);
        continue;
      }
      const bool is_small = number != 0 && std::fabs(number) < 0x1p-14 * halves.scale;
      small += is_small ? 1 : 0;
      ASSERT_LE(std::fabs(back[i] - number),
                is_small ? 0x1p-25 * halves.scale : kHalfError * std::fabs(number))
          << numbers[i] << " of " << numbers[0];
    }
    EXPECT_EQ(halves.small_count, small) << largest;
    // Those that are not 2^28 times smaller have all digits.
    EXPECT_LE(small, 60u - 28u) << largest;
  }
}

TEST(HalfTest, NothingAndZerosHaveAScale) {
  EXPECT_EQ(ToHalves({}).scale, 1);
  const std::vector<float> numbers = {0, kInfinity, std::nanf("")};
  const Halves halves = ToHalves(numbers);
  EXPECT_EQ(halves.scale, 1);
  EXPECT_EQ(halves.small_count, 0u);
  const auto back = FromHalves(halves.numbers, halves.scale);
  EXPECT_EQ(back[0], 0);
  EXPECT_EQ(back[1], kInfinity);
  EXPECT_TRUE(std::isnan(back[2]));
}

}  // namespace
}  // namespace treelight
