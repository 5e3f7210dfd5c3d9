#include "core/gpu/batch_buffers.h"

namespace treelight {

BatchBuffers UploadBatch(const Gpu& gpu, const GatherQueries& queries,
                         const GatherOptions& options) {
  const std::size_t m = queries.size();
  const auto wants = [&](std::uint32_t output) { return (options.outputs & output) != 0; };
  BatchBuffers batch;
  batch.positions = MakeBuffer(gpu.memory(), gpu.queue(), queries.positions);
  batch.radii_in = MakeBuffer(gpu.memory(), gpu.queue(), queries.radii);
  batch.normals = MakeBuffer(gpu.memory(), gpu.queue(), queries.normals);
  const bool lists = wants(kOutputNeighbors) && options.k == 0;
  batch.counts = Buffer<cl_uint>(gpu.memory(), wants(kOutputCount) || lists ? m : 0);
  batch.radii = Buffer<float>(gpu.memory(), wants(kOutputRadius) ? m : 0);
  batch.densities = Buffer<float>(gpu.memory(), wants(kOutputDensity) ? 3 * m : 0);
  batch.neighbor_ids = Buffer<cl_uint>(gpu.memory(), wants(kOutputNeighbors) ? m * options.k : 0);
  batch.neighbor_d2 = Buffer<float>(gpu.memory(), wants(kOutputNeighbors) ? m * options.k : 0);
  batch.error_bounds = Buffer<float>(gpu.memory(), options.approximation.any() ? m : 0);
  batch.visited = Buffer<cl_uint>(gpu.memory(), wants(kOutputStatistics) ? m : 0);
  batch.tested = Buffer<cl_uint>(gpu.memory(), wants(kOutputStatistics) ? m : 0);
  return batch;
}

}  // namespace treelight
