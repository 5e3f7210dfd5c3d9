#include "core/gpu/radix_sort.h"

#include <type_traits>
#include <utility>

#include "core/gpu/scan.h"

namespace treelight {

template <typename Key>
void RadixSort(const Gpu& gpu, KeyValues<Key>& pairs, std::size_t count, unsigned key_bits) {
  constexpr std::size_t kTile = kGroupSize * kSortItems;
  constexpr std::size_t kDigits = 256;  // SORT_DIGITS
  if (count < 2) return;
  const cl::Program& program = std::is_same_v<Key, cl_ulong> ? gpu.sort_64 : gpu.sort_32;
  const std::size_t tile_count = (count + kTile - 1) / kTile;
  const auto n = static_cast<cl_uint>(count);
  KeyValues<Key> other(gpu.context(), pairs.keys.size());
  const Buffer<cl_uint> counts(gpu.context(), kDigits * tile_count);
  for (cl_uint shift = 0; shift < key_bits; shift += 8) {
    Launch(gpu, program, "radix_count", tile_count * kGroupSize, kGroupSize, pairs.keys.get(), n,
           shift, counts.get());
    ExclusiveScan(gpu, counts, kDigits * tile_count);
    Launch(gpu, program, "radix_scatter", tile_count * kGroupSize, kGroupSize, pairs.keys.get(),
           pairs.values.get(), n, shift, counts.get(), other.keys.get(), other.values.get());
    std::swap(pairs, other);
  }
}

template void RadixSort<cl_uint>(const Gpu&, KeyValues<cl_uint>&, std::size_t, unsigned);
template void RadixSort<cl_ulong>(const Gpu&, KeyValues<cl_ulong>&, std::size_t, unsigned);

}  // namespace treelight
