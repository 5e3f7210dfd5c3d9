#include "core/model/first_beyond.h"

#include <limits>
#include <random>
#include <vector>

#include "gtest/gtest.h"

namespace treelight {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(FirstBeyondTest, FindsTheFirstOneWhereverItIs) {
  for (const std::size_t size : {1u, 7u, 4095u, 4096u, 4097u, 20000u}) {
    for (const std::size_t place : {std::size_t{0}, size / 2, size - 1}) {
      for (const float wrong : {kNan, kInfinity, -kInfinity, 5.5f, -5.5f}) {
        std::vector<float> numbers(size, 5.0f);
        numbers[place] = wrong;
        numbers.back() = place + 1 < size ? kNan : wrong;  // a later one does not matter
        EXPECT_EQ(FirstBeyond(numbers, 5), place) << size << " " << wrong;
      }
    }
  }
}

TEST(FirstBeyondTest, TheLimitAndZerosAreWithinIt) {
  EXPECT_EQ(FirstBeyond({}, 1), 0u);
  const std::vector<float> numbers = {5, -5, 0, -0.0f, std::numeric_limits<float>::denorm_min()};
  EXPECT_EQ(FirstBeyond(numbers, 5), numbers.size());
  const float largest = std::numeric_limits<float>::max();
  EXPECT_EQ(FirstBeyond(std::vector<float>{largest, -largest, kInfinity}, largest), 2u);
}

TEST(FirstBeyondTest, FreshNumbersAgreeWithALoop) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 100; ++i) {
    std::vector<float> numbers(random() % 10000);
    for (float& number : numbers) number = normal(random);
    std::size_t expected = 0;
    while (expected < numbers.size() && numbers[expected] >= -3.5f && numbers[expected] <= 3.5f)
      ++expected;
    EXPECT_EQ(FirstBeyond(numbers, 3.5f), expected);
  }
}

}  // namespace
}  // namespace treelight
