#ifndef TREELIGHT_CORE_GPU_QUERY_ORDER_H_
#define TREELIGHT_CORE_GPU_QUERY_ORDER_H_

#include <cstddef>

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/kernels/types.h"

namespace treelight {

/// Decides the order in which the queries of a batch are worked on.
class QueryOrder {
 public:
  /// Does not wait.
  explicit QueryOrder(const Gpu& gpu);

  /// The numbers of the `count` queries at `positions` [3 * count] in the order of their Morton
  /// codes, or as they came where that is an order as good (query_order.cl). Once. Does not wait,
  /// unless without sub-groups.
  Buffer<cl_uint> Find(const Buffer<float>& positions, std::size_t count,
                       const Buffer<MortonGrid>& grid);

 private:
  const Gpu& gpu_;
  Buffer<cl_int> score_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_QUERY_ORDER_H_
