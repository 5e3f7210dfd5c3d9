#ifndef TREELIGHT_CORE_GPU_RADIX_SORT_H_
#define TREELIGHT_CORE_GPU_RADIX_SORT_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// Pairs of a key and a value; Key is cl_uint or cl_ulong. Both buffers have the same size.
template <typename Key>
struct KeyValues {
  KeyValues(BufferPool& pool, std::size_t count) : keys(pool, count), values(pool, count) {}
  Buffer<Key> keys;
  Buffer<cl_uint> values;
};

/// Pairs of a sort, at most: the one-sweep sort tells of sums below 2^30.
inline constexpr std::size_t kMaxSortedPairs = (std::size_t{1} << 30) - 1;

/// What may spare a sort: a number on the device by the time when the sort begins.
struct SortUnless {
  Buffer<cl_int> found;  ///< [1]; empty: nothing spares it
  cl_int most = 0;       ///< the pairs stay as they are where `found` is larger
};

/// Sorts the first `count` pairs by the lowest `key_bits` of their keys, ascending and stable
/// (radix_sort.cl, or radix_sort_onesweep.cl where there are sub-groups). At most
/// kMaxSortedPairs. The buffers of `pairs` may be exchanged for others of the same size. Does not
/// wait, unless without sub-groups for `unless`.
template <typename Key>
void RadixSort(const Gpu& gpu, KeyValues<Key>& pairs, std::size_t count, unsigned key_bits,
               const SortUnless& unless = {});

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_RADIX_SORT_H_
