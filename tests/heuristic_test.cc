#include "core/model/heuristic.h"

#include "core/model/tree.h"
#include "gtest/gtest.h"
#include "tests/clouds.h"

namespace treelight {
namespace {

/// The measure by its definition, in double and scene units.
double PlainMeasure(Heuristic heuristic, const Box& box, double radius) {
  const double grow = heuristic == Heuristic::kSah ? 0 : 2 * radius;
  const double dx = double{box.max.x} - box.min.x + grow, dy = double{box.max.y} - box.min.y + grow,
               dz = double{box.max.z} - box.min.z + grow;
  return heuristic == Heuristic::kVvh ? dx * dy * dz : dx * dy + dy * dz + dz * dx;
}

TEST(HeuristicTest, MeasuresAreThoseOfTheDefinitionAtEveryScale) {
  const Box root{{-1, 2, 3}, {4, 5, 7}}, part{{0, 2, 3.5f}, {1, 3.25f, 5}};
  for (const float unit : {1.0f, 0x1p-120f, 0x1p50f}) {
    const auto scaled = [&](const Box& b) {
      return Box{{b.min.x * unit, b.min.y * unit, b.min.z * unit},
                 {b.max.x * unit, b.max.y * unit, b.max.z * unit}};
    };
    for (const Heuristic heuristic : {Heuristic::kSah, Heuristic::kIsa, Heuristic::kVvh}) {
      const Measure measure(heuristic, scaled(root), 0.3f * unit);
      const double expected =
          PlainMeasure(heuristic, part, 0.3f) / PlainMeasure(heuristic, root, 0.3f);
      EXPECT_NEAR(measure(scaled(part)) / measure(scaled(root)), expected, 1e-6 * expected);
      EXPECT_EQ(measure(scaled(part)), Measure(heuristic, root, 0.3f)(part)) << unit;
    }
  }
}

TEST(HeuristicTest, WorkedExample) {
  // Longest edge 8 becomes 0.5 at scale 1/16; radius 1 grows each side by 1/16.
  const Box root{{0, 0, 0}, {8, 4, 4}}, part{{0, 0, 0}, {2, 2, 0}};
  EXPECT_EQ(Measure(Heuristic::kSah, root, 1)(part), 0.125f * 0.125f);
  EXPECT_EQ(Measure(Heuristic::kIsa, root, 1)(part),
            0.25f * 0.25f + 0.25f * 0.125f + 0.125f * 0.25f);
  EXPECT_EQ(Measure(Heuristic::kVvh, root, 1)(part), 0.25f * 0.25f * 0.125f);
}

TEST(HeuristicTest, WithoutARadiusBoxesOfALineStillDiffer) {
  const Box line{{0, 0, 0}, {1, 0, 0}}, half{{0, 0, 0}, {0.5f, 0, 0}};
  for (const Heuristic heuristic : {Heuristic::kIsa, Heuristic::kVvh}) {
    const Measure measure(heuristic, line, 0);
    EXPECT_GT(measure(line), measure(half));
    EXPECT_GT(measure(half), 0);
  }
  const Box point{{3, 3, 3}, {3, 3, 3}};
  EXPECT_GT(Measure(Heuristic::kIsa, point, 0)(point), 0);
}

TEST(HeuristicTest, CostOfATreeOfTwoLeaves) {
  Tree tree;
  tree.root = {{0, 0, 0}, {3, 1, 1}, 0, 2, 1};
  tree.nodes = {{{0, 0, 0}, {1, 1, 1}, {2, 0, 0}, {3, 1, 1}, kLeafBit, kLeafBit | 1, 1, 1}};
  const double root = 2 * (3 + 1 + 3), leaf = 6;
  EXPECT_DOUBLE_EQ(HeuristicCost(tree, Heuristic::kSah, 0), (root + 2 * leaf) / root);
  EXPECT_DOUBLE_EQ(HeuristicCost(tree, Heuristic::kSah, 5), (root + 2 * leaf) / root);
  // Grown by 1: edges 5, 3, 3 and 3, 3, 3.
  EXPECT_DOUBLE_EQ(HeuristicCost(tree, Heuristic::kIsa, 1), 1 + 2 * 54.0 / 78);
  EXPECT_DOUBLE_EQ(HeuristicCost(tree, Heuristic::kVvh, 1), 1 + 2 * 27.0 / 45);
  EXPECT_EQ(HeuristicCost(Tree(), Heuristic::kSah, 0), 0);
}

}  // namespace
}  // namespace treelight
