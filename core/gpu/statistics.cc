#include "core/gpu/statistics.h"

#include <algorithm>
#include <iterator>
#include <numeric>

namespace treelight {

TreeStatistics SumStatistics(const Gpu& gpu, std::size_t leaf_count, DeviceTree& tree) {
  const Buffer<TreeSums> device_sums(gpu.memory(), 1);
  Launch(gpu, gpu.stages, "tree_sums", kTreeSumGroups * kGroupSize, kGroupSize, tree.nodes.get(),
         static_cast<cl_uint>(leaf_count - 1), tree.climbs.get(), tree.block_flags.get(),
         tree.device_root.get(), device_sums.get());
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

  const Box box{{root.min[0], root.min[1], root.min[2]}, {root.max[0], root.max[1], root.max[2]}};
  const float longest =
      std::max({box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  const double scale = longest > 0 ? std::min(1 / longest, 0x1p100f) : 0;  // area_scale
  const double root_area = SurfaceArea(box) * scale * scale;
  const double area = std::accumulate(std::begin(sums.areas), std::end(sums.areas), 0.0);
  statistics.sah_cost = root_area > 0 ? 1 + area / root_area : 0;
  return statistics;
}

}  // namespace treelight
