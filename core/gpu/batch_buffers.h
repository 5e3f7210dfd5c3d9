#ifndef TREELIGHT_CORE_GPU_BATCH_BUFFERS_H_
#define TREELIGHT_CORE_GPU_BATCH_BUFFERS_H_

#include "core/device/buffer.h"
#include "core/gatherer.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// The arrays of one batch on the device.
struct BatchBuffers {
  Buffer<float> positions, radii_in, normals;
  Buffer<cl_uint> order;  ///< not there yet
  Buffer<cl_uint> counts, neighbor_ids, visited, tested;
  Buffer<float> radii, neighbor_d2, densities, error_bounds;
};

/// Uploads the queries and makes room for the answers that are asked for. Waits.
BatchBuffers UploadBatch(const Gpu& gpu, const GatherQueries& queries,
                         const GatherOptions& options);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_BATCH_BUFFERS_H_
