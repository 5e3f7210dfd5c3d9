#include <algorithm>
#include <vector>

#include "core/model/tree.h"

namespace treelight {
namespace {

struct Visit {
  std::uint32_t link;
  std::uint32_t depth;
};

Box MakeBox(const float* min, const float* max) {
  return {{min[0], min[1], min[2]}, {max[0], max[1], max[2]}};
}

}  // namespace

TreeStatistics ComputeStatistics(const Tree& tree) {
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
  return statistics;
}

}  // namespace treelight
