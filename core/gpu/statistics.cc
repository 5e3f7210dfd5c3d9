#include "core/gpu/statistics.h"

#include <algorithm>
#include <numeric>

namespace treelight {

TreeStatistics SumStatistics(const Gpu& gpu, const DeviceTree& tree, std::size_t leaf_count) {
  const Root& root = tree.root;
  TreeStatistics statistics;
  statistics.node_count = static_cast<std::uint32_t>(leaf_count - 1);
  statistics.leaf_count = static_cast<std::uint32_t>(leaf_count);
  statistics.depth = root.depth;
  statistics.leaf_fill = static_cast<double>(root.count) / static_cast<double>(leaf_count);

  const Box box{{root.min[0], root.min[1], root.min[2]}, {root.max[0], root.max[1], root.max[2]}};
  const double longest =
      std::max({box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  const double scale = longest > 0 ? std::min(1 / longest, 0x1p100) : 0;  // in the range of float
  constexpr std::size_t kGroupCount =
      64;  // the same on every device, so that the sums have the same bits
  const Buffer<float> areas(gpu.memory(), kGroupCount);
  const Buffer<cl_ulong> depths(gpu.memory(), kGroupCount);
  Launch(gpu, gpu.stages, "tree_sums", kGroupCount * kGroupSize, kGroupSize, tree.nodes.get(),
         static_cast<cl_uint>(leaf_count - 1), static_cast<float>(scale), tree.climbs.get(),
         areas.get(), depths.get());
  const auto area_parts = areas.Read(gpu.queue());
  const auto depth_parts = depths.Read(gpu.queue());
  const double root_area = SurfaceArea(box) * scale * scale;
  const double area = std::accumulate(area_parts.begin(), area_parts.end(), 0.0);
  const auto depth = std::accumulate(depth_parts.begin(), depth_parts.end(), cl_ulong{0});
  statistics.mean_leaf_depth = static_cast<double>(depth) / static_cast<double>(leaf_count);
  statistics.sah_cost = root_area > 0 ? 1 + area / root_area : 0;
  return statistics;
}

}  // namespace treelight
