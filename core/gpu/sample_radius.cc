#include "core/gpu/sample_radius.h"

#include <algorithm>
#include <limits>
#include <span>

#include "core/cpu/gather_radius.h"

namespace treelight {

float SampleGatherRadius(const Gpu& gpu, const DeviceTree& tree,
                         const std::vector<float>& positions, std::uint32_t seed) {
  std::vector<float> queries;
  const auto count = static_cast<std::uint32_t>(positions.size() / 3);
  for (const std::uint32_t id : SamplePhotons(count, seed)) {
    const float* p = &positions[3 * std::size_t{id}];
    queries.insert(queries.end(), p, p + 3);
  }
  GatherParams params{};
  params.root = tree.device_root.ReadAt(gpu.queue(), 0);
  params.count = kRadiusSamples;
  params.k = std::min(kRadiusNeighbors, count);
  params.radius = std::numeric_limits<float>::infinity();
  params.outputs = kOutputRadius;
  const auto positions_in = MakeBuffer(gpu.memory(), gpu.queue(), std::span<const float>(queries));
  const Buffer<float> radii(gpu.memory(), kRadiusSamples);
  const Buffer<cl_uint> unused(gpu.memory(), 0);
  const std::size_t group = kSubGroupSize;  // few queries: many groups
  Launch(gpu, gpu.gather, "gather_nearest", kRadiusSamples, group, tree.nodes.get(),
         tree.min_ids.get(), tree.photons.get(), unused.get(), positions_in.get(), unused.get(),
         unused.get(), unused.get(), params, unused.get(), radii.get(), unused.get(), unused.get(),
         unused.get(), unused.get(), unused.get(), cl::Local(params.k * group * sizeof(cl_ulong)));
  return MedianRadius(radii.Read(gpu.queue()));
}

}  // namespace treelight
