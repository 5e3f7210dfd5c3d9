#include "core/gpu/radix_sort.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "core/gpu/scan.h"

namespace treelight {

namespace {

constexpr std::size_t kDigits = 256;  // SORT_DIGITS, SWEEP_DIGITS

template <typename Key>
void CountScanScatter(const Gpu& gpu, KeyValues<Key>& pairs, std::size_t count, unsigned key_bits) {
  constexpr std::size_t kTile = kGroupSize * kSortItems;
  const cl::Program& program = std::is_same_v<Key, cl_ulong> ? gpu.sort_64 : gpu.sort_32;
  const std::size_t tile_count = (count + kTile - 1) / kTile;
  const auto n = static_cast<cl_uint>(count);
  KeyValues<Key> other(gpu.memory(), pairs.keys.size());
  const Buffer<cl_uint> counts(gpu.memory(), kDigits * tile_count);
  for (cl_uint shift = 0; shift < key_bits; shift += 8) {
    Launch(gpu, program, "radix_count", tile_count * kGroupSize, kGroupSize, pairs.keys.get(), n,
           shift, counts.get());
    ExclusiveScan(gpu, counts, kDigits * tile_count);
    Launch(gpu, program, "radix_scatter", tile_count * kGroupSize, kGroupSize, pairs.keys.get(),
           pairs.values.get(), n, shift, counts.get(), other.keys.get(), other.values.get());
    std::swap(pairs, other);
  }
}

template <typename Key>
void Onesweep(const Gpu& gpu, KeyValues<Key>& pairs, std::size_t count, unsigned key_bits,
              const SortUnless& unless) {
  const std::size_t tile = kSweepGroupSize * kSweepItems<Key>;
  const cl::Program& program = std::is_same_v<Key, cl_ulong> ? gpu.sort_64 : gpu.sort_32;
  const std::size_t tile_count = (count + tile - 1) / tile;
  const auto n = static_cast<cl_uint>(count);
  const bool always = unless.found.size() == 0;
  // An even number of passes leaves the pairs where they were, so that all may be left out.
  cl_uint pass_count = (key_bits + 7) / 8;
  if (!always) pass_count += pass_count % 2;
  KeyValues<Key> other(gpu.memory(), pairs.keys.size());
  // Of each pass: the counts of its digits, the number of its tiles begun, their states.
  const std::size_t states_at = pass_count * (kDigits + 1);
  const Buffer<cl_uint> sweep(gpu.memory(), states_at + pass_count * tile_count * kDigits);
  sweep.Fill(gpu.queue(), 0);
  const cl::Buffer& found = always ? sweep.get() : unless.found.get();
  const cl_int most = always ? CL_INT_MAX : unless.most;
  const std::size_t counting_groups =
      std::min(tile_count * 4, std::size_t{4} * gpu.device->info().compute_units);
  Launch(gpu, program, "sweep_count", counting_groups * kGroupSize, kGroupSize, pairs.keys.get(), n,
         pass_count, found, most, sweep.get());
  for (cl_uint pass = 0; pass < pass_count; ++pass) {
    Launch(gpu, program, "sweep_pass", tile_count * kSweepGroupSize, kSweepGroupSize,
           pairs.keys.get(), pairs.values.get(), n, 8 * pass, found, most, sweep.get(),
           static_cast<cl_uint>(pass * kDigits), static_cast<cl_uint>(pass_count * kDigits + pass),
           static_cast<cl_uint>(states_at + pass * tile_count * kDigits), other.keys.get(),
           other.values.get());
    std::swap(pairs, other);
  }
}

}  // namespace

template <typename Key>
void RadixSort(const Gpu& gpu, KeyValues<Key>& pairs, std::size_t count, unsigned key_bits,
               const SortUnless& unless) {
  if (count < 2) return;
  if (gpu.device->has_sub_groups()) {
    Onesweep(gpu, pairs, count, key_bits, unless);
  } else if (unless.found.size() == 0 || unless.found.ReadAt(gpu.queue(), 0) <= unless.most) {
    CountScanScatter(gpu, pairs, count, key_bits);
  }
}

template void RadixSort<cl_uint>(const Gpu&, KeyValues<cl_uint>&, std::size_t, unsigned,
                                 const SortUnless&);
template void RadixSort<cl_ulong>(const Gpu&, KeyValues<cl_ulong>&, std::size_t, unsigned,
                                  const SortUnless&);

}  // namespace treelight
