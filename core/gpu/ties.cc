#include "core/gpu/ties.h"

#include <bit>

#include "core/device/guard.h"
#include "core/gpu/radix_sort.h"
#include "core/gpu/scan.h"
#include "core/kernels/types.h"

namespace treelight {
namespace {

/// The photons of all runs that are too long, listed in leaf order.
struct TiedRuns {
  std::size_t count = 0;  // photons
  std::size_t run_count = 0;
  Buffer<cl_uint> slots;       // [count] places in leaf order
  Buffer<cl_uint> runs;        // [count + 1] photon j is in run runs[j + 1] - 1
  Buffer<cl_uint> run_firsts;  // [run_count + 1]
  Buffer<cl_uint> boxes;       // [6 * run_count] ordered bits
};

TiedRuns FindTiedRuns(const Gpu& gpu, const Buffer<float>& positions, std::size_t count,
                      std::uint32_t max_leaf_size, const Buffer<cl_uint>& ids,
                      const Buffer<cl_uchar>& levels) {
  TiedRuns tied;
  const auto n = static_cast<cl_uint>(count);
  const Buffer<cl_uint> places(gpu.memory(), count + 1), any(gpu.memory(), 1);
  any.Fill(gpu.queue(), 0);
  Launch(gpu, gpu.stages, "tie_flags", count + 1, kGroupSize, levels.get(), n, max_leaf_size,
         places.get(), any.get());
  if (any.ReadAt(gpu.queue(), 0) == 0) return tied;

  // List the photons and number their runs.
  ExclusiveScan(gpu, places, count + 1);
  tied.count = places.ReadAt(gpu.queue(), count);
  tied.slots = Buffer<cl_uint>(gpu.memory(), tied.count);
  tied.runs = Buffer<cl_uint>(gpu.memory(), tied.count + 1);
  Launch(gpu, gpu.stages, "tie_slots", count, kGroupSize, levels.get(), n, places.get(),
         tied.slots.get(), tied.runs.get());
  ExclusiveScan(gpu, tied.runs, tied.count + 1);
  tied.run_count = tied.runs.ReadAt(gpu.queue(), tied.count);

  // Compute the box of each run.
  const auto m = static_cast<cl_uint>(tied.count);
  tied.run_firsts = Buffer<cl_uint>(gpu.memory(), tied.run_count + 1);
  tied.boxes = Buffer<cl_uint>(gpu.memory(), 6 * tied.run_count);
  Launch(gpu, gpu.stages, "tie_runs", tied.count, kGroupSize, tied.runs.get(), m,
         tied.run_firsts.get(), tied.boxes.get());
  Launch(gpu, gpu.stages, "tie_boxes", (tied.count + kTieItems - 1) / kTieItems, kGroupSize,
         positions.get(), ids.get(), tied.slots.get(), tied.runs.get(), m, tied.boxes.get());
  return tied;
}

/// Tells the photons of each run apart by a code within the run's box; its first bit splits at
/// level `base`.
void SplitByCodes(const Gpu& gpu, const Buffer<float>& positions, const TiedRuns& tied,
                  unsigned base, const Buffer<cl_uint>& ids, const Buffer<cl_uchar>& levels) {
  const auto m = static_cast<cl_uint>(tied.count);
  KeyValues<cl_ulong> pairs(gpu.memory(), tied.count);
  Launch(gpu, gpu.stages, "tie_codes", tied.count, kGroupSize, positions.get(), ids.get(),
         tied.slots.get(), tied.runs.get(), m, tied.boxes.get(), pairs.keys.get(),
         pairs.values.get());
  RadixSort(gpu, pairs, tied.count, kTieBits + std::bit_width(tied.run_count - 1));
  Launch(gpu, gpu.stages, "tie_levels_of_codes", tied.count, kGroupSize, tied.slots.get(),
         tied.runs.get(), m, tied.boxes.get(), pairs.keys.get(), pairs.values.get(), cl_uint{base},
         ids.get(), levels.get());
}

/// Splits each run once, near the median of its widest axis, at `level`.
void SplitByMedians(const Gpu& gpu, const Buffer<float>& positions, const TiedRuns& tied,
                    unsigned level, std::uint32_t max_leaf_size, const Buffer<cl_uint>& ids,
                    const Buffer<cl_uchar>& levels) {
  const auto m = static_cast<cl_uint>(tied.count);
  KeyValues<cl_ulong> pairs(gpu.memory(), tied.count);
  Launch(gpu, gpu.stages, "tie_coordinates", tied.count, kGroupSize, positions.get(), ids.get(),
         tied.slots.get(), tied.runs.get(), m, tied.boxes.get(), pairs.keys.get(),
         pairs.values.get());
  RadixSort(gpu, pairs, tied.count, 32 + std::bit_width(tied.run_count - 1));
  Launch(gpu, gpu.stages, "tie_levels_of_medians", tied.count, kGroupSize, tied.slots.get(),
         tied.runs.get(), m, tied.run_firsts.get(), tied.boxes.get(), pairs.values.get(),
         max_leaf_size, cl_uint{level}, ids.get(), levels.get());
}

/// Splits by place what is not yet told apart, where `rest` [1] is 0.
void SplitByPlaces(const Gpu& gpu, std::size_t count, const Buffer<cl_uint>& rest,
                   const Buffer<cl_uchar>& levels) {
  Launch(gpu, gpu.stages, "tie_levels_of_places", count, kGroupSize, rest.get(), levels.get(),
         static_cast<cl_uint>(count));
}

}  // namespace

Buffer<cl_uint> BreakShortTies(const Gpu& gpu, const Buffer<float>& positions, std::size_t count,
                               unsigned code_bits, std::uint32_t max_leaf_size,
                               const Buffer<cl_uint>& ids, const Buffer<cl_uchar>& levels) {
  Buffer<cl_uint> rest(gpu.memory(), 1);
  rest.Fill(gpu.queue(), 0);
  Launch(gpu, gpu.sub_group_stages, "tie_short_runs", (count + kTieBoundaries - 1) / kTieBoundaries,
         kSubGroupSize * kSubGroupsPerGroup, positions.get(), static_cast<cl_uint>(count),
         max_leaf_size, cl_uint{code_bits}, ids.get(), levels.get(), rest.get());
  SplitByPlaces(gpu, count, rest, levels);
  return rest;
}

TieReport BreakTies(const Gpu& gpu, const Buffer<float>& positions, std::size_t count,
                    unsigned code_bits, std::uint32_t max_leaf_size, const Buffer<cl_uint>& ids,
                    const Buffer<cl_uchar>& levels, const CancelCheck& cancelled) {
  constexpr unsigned kLastCodeLevel = 93;  // depth left for medians and places: 35
  TieReport report;
  Buffer<cl_uint> rest;
  if (gpu.device->has_sub_groups()) {
    rest = BreakShortTies(gpu, positions, count, code_bits, max_leaf_size, ids, levels);
    if (rest.ReadAt(gpu.queue(), 0) == 0) return report;
  } else {
    rest = Buffer<cl_uint>(gpu.memory(), 1);
  }
  for (unsigned level = code_bits;;) {
    ThrowIfCancelled(cancelled);
    const TiedRuns tied = FindTiedRuns(gpu, positions, count, max_leaf_size, ids, levels);
    if (report.code_rounds + report.median_rounds == 0) report.tied_photons = tied.count;
    if (tied.count == 0) break;
    if (level + kTieBits <= kLastCodeLevel) {
      SplitByCodes(gpu, positions, tied, level, ids, levels);
      level += kTieBits;
      ++report.code_rounds;
    } else {
      SplitByMedians(gpu, positions, tied, level, max_leaf_size, ids, levels);
      ++level;
      ++report.median_rounds;
    }
  }
  rest.Fill(gpu.queue(), 0);
  SplitByPlaces(gpu, count, rest, levels);
  return report;
}

}  // namespace treelight
