// Runs of equal codes longer than a leaf, rebuilt by position. Split by index they would become
// overlapping subtrees that a search must visit all. Each run gets a finer code within its own box;
// what is still tied after the rounds that the depth allows is split at medians of the widest axis;
// photons at one position are split by place. Uses morton.cl.

/// Flags the photons in runs of equal codes of more than `max_leaf_size`. One work-item per photon
/// and one more.
/// @param levels  [n - 1]
/// @param flags   [n + 1] out: 1 for a photon of such a run, else 0; flags[n] is 0
/// @param any     [1] out: not 0 where there is such a photon; 0 before
kernel void tie_flags(global const uchar* restrict levels, const uint n, const uint max_leaf_size,
                      global uint* restrict flags, global uint* restrict any) {
  const uint i = get_global_id(0);
  if (i > n) return;
  uint length = 1;
  if (i < n) {
    for (uint j = i; j > 0 && length <= max_leaf_size && levels[j - 1] == kLevelTied; --j) ++length;
    for (uint j = i; j + 1 < n && length <= max_leaf_size && levels[j] == kLevelTied; ++j) ++length;
  }
  flags[i] = length > max_leaf_size ? 1 : 0;
  if (length > max_leaf_size) any[0] = 1;  // all writers write the same
}

/// Lists the flagged photons. One work-item per photon.
/// @param places  [n + 1] exclusive sum of the flags
/// @param slots   [m] out: places in leaf order of the flagged photons, ascending
/// @param heads   [m + 1] out: 1 where a run begins, else 0; heads[m] is 0
kernel void tie_slots(global const uchar* restrict levels, const uint n,
                      global const uint* restrict places, global uint* restrict slots,
                      global uint* restrict heads) {
  const uint i = get_global_id(0);
  if (i == 0) heads[places[n]] = 0;
  if (i >= n || places[i] == places[i + 1]) return;
  slots[places[i]] = i;
  heads[places[i]] = i == 0 || levels[i - 1] != kLevelTied ? 1 : 0;
}

/// Prepares the runs. One work-item per listed photon.
/// @param runs        [m + 1] exclusive sum of the heads: photon j is in run runs[j + 1] - 1
/// @param run_firsts  [run_count + 1] out: where each run begins in the list
/// @param boxes       [6 * run_count] out: empty boxes, as ordered bits
kernel void tie_runs(global const uint* restrict runs, const uint m,
                     global uint* restrict run_firsts, global uint* restrict boxes) {
  const uint j = get_global_id(0);
  if (j >= m) return;
  if (j == 0) run_firsts[runs[m]] = m;
  if (runs[j] == runs[j + 1]) return;
  const uint run = runs[j];
  run_firsts[run] = j;
  for (uint c = 0; c < 3; ++c) {
    boxes[6 * run + c] = 0xffffffffu;
    boxes[6 * run + 3 + c] = 0;
  }
}

#ifndef TIE_ITEMS
#define TIE_ITEMS 16  // photons of one work-item of tie_boxes
#endif

void extend_box(global uint* box, const uint3 low, const uint3 high) {
  // Minimum and maximum do not depend on the order in which the items come; nothing else is read
  // from their writes before the launch ends.
  atomic_min(&box[0], low.x);
  atomic_min(&box[1], low.y);
  atomic_min(&box[2], low.z);
  atomic_max(&box[3], high.x);
  atomic_max(&box[4], high.y);
  atomic_max(&box[5], high.z);
}

/// Computes the box of each run. One work-item per TIE_ITEMS listed photons.
/// @param ids    [n] photon at each place of the leaf order
/// @param boxes  [6 * run_count] in/out: minimum, maximum as ordered bits
kernel void tie_boxes(global const float* restrict positions, global const uint* restrict ids,
                      global const uint* restrict slots, global const uint* restrict runs,
                      const uint m, global uint* boxes) {
  const uint first = get_global_id(0) * TIE_ITEMS;
  if (first >= m) return;
  const uint last = min(first + TIE_ITEMS, m);
  uint run = runs[first + 1] - 1;
  uint3 low = 0xffffffffu, high = 0;
  for (uint j = first; j < last; ++j) {
    if (runs[j + 1] - 1 != run) {
      extend_box(&boxes[6 * run], low, high);
      run = runs[j + 1] - 1;
      low = 0xffffffffu;
      high = 0;
    }
    const float3 p = load_position(positions, ids[slots[j]]);
    const uint3 bits = (uint3)(ordered_bits(p.x), ordered_bits(p.y), ordered_bits(p.z));
    low = min(low, bits);
    high = max(high, bits);
  }
  extend_box(&boxes[6 * run], low, high);
}

float3 box_low(global const uint* box) {
  return (float3)(from_ordered_bits(box[0]), from_ordered_bits(box[1]), from_ordered_bits(box[2]));
}

float3 box_extent(global const uint* box) {
  return (float3)(from_ordered_bits(box[3]), from_ordered_bits(box[4]), from_ordered_bits(box[5])) -
         box_low(box);
}

// Cube of 1024^3 cells over a box, its scale a power of two: exact without a division. Half to all
// of the cells are used along the longest edge.
MortonGrid grid_of(const float3 low, const float3 extent) {
  float longest = fmax(fmax(extent.x, extent.y), extent.z);
  MortonGrid grid;
  vstore3(low, 0, grid.min);
  grid.prescale = longest < 0x1p-60f ? 0x1p96f : 1.0f;
  longest *= grid.prescale;
  const int exponent = (int)(as_uint(longest) >> 23) - 127;
  const float scale = longest > 0 ? as_float((uint)(127 + 9 - exponent) << 23) : 0.0f;
  for (uint c = 0; c < 3; ++c) grid.scale[c] = scale;
  return grid;
}

MortonGrid grid_of_box(global const uint* box) { return grid_of(box_low(box), box_extent(box)); }

/// Computes the finer codes. One work-item per listed photon.
/// @param keys    [m] out: run << kTieBits | code of the photon within the run's box
/// @param values  [m] out: photon index
kernel void tie_codes(global const float* restrict positions, global const uint* restrict ids,
                      global const uint* restrict slots, global const uint* restrict runs,
                      const uint m, global const uint* restrict boxes, global ulong* restrict keys,
                      global uint* restrict values) {
  const uint j = get_global_id(0);
  if (j >= m) return;
  const uint run = runs[j + 1] - 1;
  const uint id = ids[slots[j]];
  keys[j] = ((ulong)run << kTieBits) |
            morton_code_30(load_position(positions, id), grid_of_box(&boxes[6 * run]));
  values[j] = id;
}

/// Puts the photons sorted by tie_codes back and sets the levels between them. One work-item per
/// listed photon.
/// @param base    level of the first bit of the codes
/// @param ids     [n] out at the slots
/// @param levels  [n - 1] out within the runs: base + shared prefix, kLevelTied, or kLevelSame
kernel void tie_levels_of_codes(global const uint* restrict slots, global const uint* restrict runs,
                                const uint m, global const uint* restrict boxes,
                                global const ulong* restrict keys,
                                global const uint* restrict values, const uint base,
                                global uint* restrict ids, global uchar* restrict levels) {
  const uint j = get_global_id(0);
  if (j >= m) return;
  const uint slot = slots[j];
  ids[slot] = values[j];
  if (j + 1 >= m || runs[j + 1] != runs[j + 2]) return;  // the last of its run
  const uint difference = (uint)(keys[j] ^ keys[j + 1]) & ((1u << kTieBits) - 1);
  if (difference != 0) {
    levels[slot] = (uchar)(base + clz(difference) - (32 - kTieBits));
  } else if (all(box_extent(&boxes[6 * (runs[j + 1] - 1)]) == 0.0f)) {
    levels[slot] = (uchar)kLevelSame;
  }
}

/// Computes keys that sort each run along the widest axis of its box. One work-item per listed
/// photon.
/// @param keys    [m] out: run << 32 | ordered bits of the coordinate
/// @param values  [m] out: photon index
kernel void tie_coordinates(global const float* restrict positions, global const uint* restrict ids,
                            global const uint* restrict slots, global const uint* restrict runs,
                            const uint m, global const uint* restrict boxes,
                            global ulong* restrict keys, global uint* restrict values) {
  const uint j = get_global_id(0);
  if (j >= m) return;
  const uint run = runs[j + 1] - 1;
  const uint id = ids[slots[j]];
  const float3 p = load_position(positions, id), extent = box_extent(&boxes[6 * run]);
  const float coordinate =
      extent.x >= extent.y && extent.x >= extent.z ? p.x : (extent.y >= extent.z ? p.y : p.z);
  keys[j] = ((ulong)run << 32) | ordered_bits(coordinate);
  values[j] = id;
}

/// Puts the photons sorted by tie_coordinates back and splits each run at the multiple of the leaf
/// size next to its median. One work-item per listed photon.
/// @param level   of the new split
/// @param ids     [n] out at the slots
/// @param levels  [n - 1] out: `level` at the splits; kLevelSame in runs at one position
kernel void tie_levels_of_medians(global const uint* restrict slots,
                                  global const uint* restrict runs, const uint m,
                                  global const uint* restrict run_firsts,
                                  global const uint* restrict boxes,
                                  global const uint* restrict values, const uint max_leaf_size,
                                  const uint level, global uint* restrict ids,
                                  global uchar* restrict levels) {
  const uint j = get_global_id(0);
  if (j >= m) return;
  const uint slot = slots[j];
  ids[slot] = values[j];
  const uint run = runs[j + 1] - 1;
  const uint size = run_firsts[run + 1] - run_firsts[run];
  if (j - run_firsts[run] == size - 1) return;  // the last of its run
  const uint leaf_count = (size + max_leaf_size - 1) / max_leaf_size;
  const uint left_size = (leaf_count + 1) / 2 * max_leaf_size;
  if (all(box_extent(&boxes[6 * run]) == 0.0f)) {
    levels[slot] = (uchar)kLevelSame;
  } else if (j - run_firsts[run] + 1 == left_size) {
    levels[slot] = (uchar)level;
  }
}

/// Splits what is left, runs of at most one leaf and photons at one position, by place (the index
/// tie-break of Karras 2012, section 4). One work-item per boundary.
/// @param rest    [1] not 0: nothing is to be done yet
/// @param levels  [n - 1] in/out
kernel void tie_levels_of_places(global const uint* restrict rest, global uchar* restrict levels,
                                 const uint n) {
  const uint i = get_global_id(0);
  if (*rest != 0) return;
  if (i + 1 >= n || levels[i] < kLevelSame) return;
  levels[i] = (uchar)(kLevelIndex + clz(i ^ (i + 1)));
}
