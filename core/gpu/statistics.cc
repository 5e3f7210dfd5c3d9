#include "core/gpu/statistics.h"

#include <algorithm>
#include <iterator>
#include <numeric>

namespace treelight {

TreeStatistics SumStatistics(const Gpu& gpu, std::size_t leaf_count, float radius,
                             DeviceTree& tree) {
  const Buffer<TreeSums> device_sums(gpu.memory(), 1);
  Launch(gpu, gpu.stages, "tree_sums", kTreeSumGroups * kGroupSize, kGroupSize, tree.nodes.get(),
         static_cast<cl_uint>(leaf_count - 1), tree.climbs.get(), tree.block_flags.get(),
         tree.device_root.get(), radius, device_sums.get());
  const TreeSums sums = device_sums.Read(gpu.queue())[0];
  tree.root = sums.root;
  tree.block_count = std::accumulate(std::begin(sums.blocks), std::end(sums.blocks), cl_uint{0});

  const Root& root = tree.root;
  TreeStatistics statistics;
  statistics.node_count = static_cast<std::uint32_t>(leaf_count - 1);
  statistics.leaf_count = static_cast<std::uint32_t>(leaf_count);
  statistics.depth = root.depth;
  statistics.leaf_fill = static_cast<double>(root.count) / static_cast<double>(leaf_count);
  const auto depth = std::accumulate(std::begin(sums.depths), std::end(sums.depths), cl_ulong{0});
  statistics.mean_leaf_depth = static_cast<double>(depth) / static_cast<double>(leaf_count);

  double extent[3], longest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    extent[axis] = double{root.max[axis]} - root.min[axis];
    longest = std::max(longest, extent[axis]);
  }
  const auto cost = [&](const float* areas, double grow) {
    const double size = longest + grow;
    const double scale = size > 0 ? std::min(1 / size, 0x1p100) : 0;  // area_scale
    const double dx = extent[0] + grow, dy = extent[1] + grow, dz = extent[2] + grow;
    const double root_area = (dx * dy + dy * dz + dz * dx) * scale * scale;
    return root_area > 0 ? 1 + std::accumulate(areas, areas + kTreeSumGroups, 0.0) / root_area : 0;
  };
  statistics.sah_cost = cost(sums.areas, 0);
  if (radius > 0) statistics.isa_cost = cost(sums.grown_areas, 2.0 * radius);
  return statistics;
}

}  // namespace treelight
