#include <algorithm>
#include <vector>

#include "core/model/tree.h"

namespace treelight {
namespace {

struct Visit {
  std::uint32_t link;
  std::uint32_t depth;
};

/// Surface area or volume of the box grown by `radius` on every side.
double GrownMeasure(const Box& box, Heuristic heuristic, double radius) {
  const double dx = double{box.max.x} - box.min.x + 2 * radius,
               dy = double{box.max.y} - box.min.y + 2 * radius,
               dz = double{box.max.z} - box.min.z + 2 * radius;
  return heuristic == Heuristic::kVvh ? dx * dy * dz : 2 * (dx * dy + dy * dz + dz * dx);
}

}  // namespace

double HeuristicCost(const Tree& tree, Heuristic heuristic, float radius) {
  if (tree.root.count == 0) return 0;
  const double grow = heuristic == Heuristic::kSah ? 0 : radius;
  const auto measure = [&](const float* min, const float* max) {
    return GrownMeasure(MakeBox(min, max), heuristic, grow);
  };
  const double root = measure(tree.root.min, tree.root.max);
  double sum = root;
  for (const Node& node : tree.nodes) {
    sum += measure(node.left_min, node.left_max) + measure(node.right_min, node.right_max);
  }
  return root > 0 ? sum / root : 0;
}

TreeStatistics ComputeStatistics(const Tree& tree, float radius) {
  TreeStatistics statistics;
  if (tree.root.count == 0) return statistics;
  const double root_area = SurfaceArea(MakeBox(tree.root.min, tree.root.max));
  double area = root_area;
  double depth_sum = 0;
  std::vector<Visit> stack{{tree.root.link, 0}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    if ((visit.link & kLeafBit) != 0) {
      ++statistics.leaf_count;
      statistics.depth = std::max(statistics.depth, visit.depth);
      depth_sum += visit.depth;
      continue;
    }
    ++statistics.node_count;
    const Node& node = tree.nodes[visit.link];
    area += SurfaceArea(MakeBox(node.left_min, node.left_max)) +
            SurfaceArea(MakeBox(node.right_min, node.right_max));
    stack.push_back({node.left, visit.depth + 1});
    stack.push_back({node.right, visit.depth + 1});
  }
  statistics.mean_leaf_depth = depth_sum / statistics.leaf_count;
  statistics.leaf_fill = static_cast<double>(tree.root.count) / statistics.leaf_count;
  statistics.sah_cost = root_area > 0 ? area / root_area : 0;
  if (radius > 0) statistics.isa_cost = HeuristicCost(tree, Heuristic::kIsa, radius);
  return statistics;
}

}  // namespace treelight
