#include "core/gpu/query_order.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "core/model/morton_grid.h"
#include "gtest/gtest.h"
#include "tests/reference.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

using Points = std::vector<float>;
using Order = std::vector<cl_uint>;

constexpr Box kUnit{{0, 0, 0}, {1, 1, 1}};

Order AsTheyCame(std::size_t count) {
  Order order(count);
  std::iota(order.begin(), order.end(), 0u);
  return order;
}

/// By the codes of `box`; queries of equal codes as they came.
Order InMortonOrder(const Points& points, const Box& box) {
  const auto codes = reference::MortonCodes(points, MakeMortonGrid(box, 10), 10);
  Order order = AsTheyCame(points.size() / 3);
  std::stable_sort(order.begin(), order.end(),
                   [&](cl_uint a, cl_uint b) { return codes[a] < codes[b]; });
  return order;
}

Points Arranged(const Points& points, const Order& order) {
  Points arranged;
  for (const cl_uint i : order)
    arranged.insert(arranged.end(), &points[3 * std::size_t{i}], &points[3 * std::size_t{i}] + 3);
  return arranged;
}

Points RandomPoints(std::size_t count, float low, float high, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(low, high);
  Points points(3 * count);
  for (float& x : points) x = coordinate(random);
  return points;
}

/// The order that the device finds in the grid of the unit cube.
Order Find(const Points& points) {
  QueryOrder order(TestGpu());
  return order
      .Find(Upload(points), points.size() / 3, Upload<MortonGrid>({MakeMortonGrid(kUnit, 10)}))
      .Read(TestGpu().queue());
}

TEST(QueryOrderTest, QueriesInNoOrderAreSorted) {
  const unsigned fresh = std::random_device{}();
  SCOPED_TRACE(fresh);
  for (const std::size_t count : {4096u, 50021u}) {
    for (const unsigned seed : {1u, fresh}) {
      const Points points = RandomPoints(count, 0, 1, seed);
      EXPECT_EQ(Find(points), InMortonOrder(points, kUnit)) << count;
      // In one caustic all are near, but in no order there.
      const Points caustic = RandomPoints(count, 0.5f, 0.51f, seed);
      EXPECT_EQ(Find(caustic), InMortonOrder(caustic, kUnit)) << count;
    }
  }
}

TEST(QueryOrderTest, AnOrderThatIsThereStays) {
  for (const std::size_t count : {4096u, 50021u}) {
    const Points points = RandomPoints(count, 0, 1, 7);
    // By codes of this grid, and of others.
    for (const Box& box : {kUnit, Box{{-0.01f, -0.02f, -0.03f}, {1.1f, 1, 1}}}) {
      const Points ordered = Arranged(points, InMortonOrder(points, box));
      EXPECT_EQ(Find(ordered), AsTheyCame(count)) << count << " " << box.max.x;
    }
  }
}

TEST(QueryOrderTest, RunsOfFewInOrderAreSorted) {
  // Every four neighbours lie together, and jump to the next four.
  const std::size_t count = 40000;
  const Points points = RandomPoints(count, 0, 1, 7);
  const Order sorted = InMortonOrder(points, kUnit);
  std::vector<std::size_t> runs(count / 4);
  std::iota(runs.begin(), runs.end(), 0u);
  std::shuffle(runs.begin(), runs.end(), std::mt19937(1));
  Order shuffled;
  for (const std::size_t run : runs)
    shuffled.insert(shuffled.end(), &sorted[4 * run], &sorted[4 * run] + 4);
  const Points arranged = Arranged(points, shuffled);
  EXPECT_EQ(Find(arranged), InMortonOrder(arranged, kUnit));
}

TEST(QueryOrderTest, QueriesAtOnePlaceAndFewAndNone) {
  EXPECT_EQ(Find(Points(3 * 5000, 0.25f)), AsTheyCame(5000));
  const Points few = RandomPoints(3, 0, 1, 1);
  const Order order = Find(few);
  EXPECT_TRUE(order == InMortonOrder(few, kUnit) || order == AsTheyCame(3));
  EXPECT_EQ(Find({}), Order{});
}

}  // namespace
}  // namespace treelight
