#include "core/gpu/query_order.h"

#include <algorithm>
#include <bit>

#include "core/gpu/radix_sort.h"

namespace treelight {

QueryOrder::QueryOrder(const Gpu& gpu) : gpu_(gpu), score_(gpu.memory(), 1) {
  score_.Fill(gpu.queue(), 0);
}

Buffer<cl_uint> QueryOrder::Find(const Buffer<float>& positions, std::size_t count,
                                 const Buffer<MortonGrid>& grid) {
  // Near is what lies within one of so many cells as leave 16 queries to each. In Morton order
  // hardly any query has its next one farther away.
  const auto n = static_cast<cl_uint>(count);
  const int levels = (std::bit_width(std::max(n / 16, 1u)) - 1) / 3;
  const cl_uint near_cells = 1024u >> std::min(levels, 10);
  KeyValues<cl_uint> codes(gpu_.memory(), count);
  Launch(gpu_, gpu_.stages, "query_codes", count, kGroupSize, positions.get(), grid.get(), n,
         near_cells, codes.keys.get(), codes.values.get(), score_.get());
  // Without any order half of those that are near are behind. The bar lies above that.
  RadixSort(gpu_, codes, count, 30, {score_, static_cast<cl_int>(n / 16 * 9)});
  return codes.values;
}

}  // namespace treelight
