// Stable least-significant-digit radix sort of (key, value) pairs, 8 bits a pass (Satish, Harris
// and Garland 2009): count the digits of each tile, scan the counts digit by digit, sort each tile
// by its digit in local memory and write the runs of equal digits out. Uses scan.cl. -DKEY_BITS: 32
// or 64.

#if KEY_BITS == 64
typedef ulong Key;
#else
typedef uint Key;
#endif
#ifndef SORT_ITEMS
#define SORT_ITEMS 8
#endif
#define SORT_TILE (GROUP_SIZE * SORT_ITEMS)
#define SORT_DIGITS 256  // as many as GROUP_SIZE: item d handles digit d

/// Counts the digits (key >> shift) & 255 of each tile. One work-group of GROUP_SIZE per tile of
/// SORT_TILE.
/// @param counts  [SORT_DIGITS * tiles] out: count of digit d in tile t at d * tiles + t
kernel void radix_count(global const Key* restrict keys, const uint n, const uint shift,
                        global uint* restrict counts) {
  local uint bins[SORT_DIGITS];
  const uint item = get_local_id(0);
  bins[item] = 0;
  // Bins are cleared by one item and counted up by others.
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint first = get_group_id(0) * SORT_TILE;
  for (uint j = item; j < SORT_TILE && first + j < n; j += GROUP_SIZE) {
    atomic_inc(&bins[(uint)(keys[first + j] >> shift) & 255u]);
  }
  // All items have counted.
  barrier(CLK_LOCAL_MEM_FENCE);
  counts[item * get_num_groups(0) + get_group_id(0)] = bins[item];
}

// Sorts the tile in local memory by 4 bits of its keys, stably: each item counts the digits of its
// own consecutive pairs, a scan in order (digit, item) gives each pair its place.
void sort_tile_by_nibble(local Key* keys, local uint* values, local ushort* counts,
                         local uint* shared, const uint shift) {
  const uint item = get_local_id(0);
  Key own_keys[SORT_ITEMS];
  uint own_values[SORT_ITEMS];
  for (uint d = 0; d < 16; ++d) counts[d * GROUP_SIZE + item] = 0;
  for (uint j = 0; j < SORT_ITEMS; ++j) {
    own_keys[j] = keys[item * SORT_ITEMS + j];
    own_values[j] = values[item * SORT_ITEMS + j];
    ++counts[((uint)(own_keys[j] >> shift) & 15u) * GROUP_SIZE + item];
  }
  // Each item sums 16 consecutive counts of all items.
  barrier(CLK_LOCAL_MEM_FENCE);
  uint sum = 0;
  for (uint j = 0; j < 16; ++j) sum += counts[item * 16 + j];
  uint total;
  uint before = scan_group(shared, sum, &total);
  for (uint j = 0; j < 16; ++j) {
    const uint count = counts[item * 16 + j];
    counts[item * 16 + j] = (ushort)before;
    before += count;
  }
  // Every item has its pairs in registers and all places are known.
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint j = 0; j < SORT_ITEMS; ++j) {
    const uint place = counts[((uint)(own_keys[j] >> shift) & 15u) * GROUP_SIZE + item]++;
    keys[place] = own_keys[j];
    values[place] = own_values[j];
  }
  // The tile is sorted before anyone reads on.
  barrier(CLK_LOCAL_MEM_FENCE);
}

/// Writes the pairs of each tile to their places in the order of the digit. Ranges as radix_count.
/// @param offsets     [SORT_DIGITS * tiles] exclusive sum of the counts
/// @param keys_out    [n] out
/// @param values_out  [n] out
kernel void radix_scatter(global const Key* restrict keys, global const uint* restrict values,
                          const uint n, const uint shift, global const uint* restrict offsets,
                          global Key* restrict keys_out, global uint* restrict values_out) {
  local Key tile_keys[SORT_TILE];
  local uint tile_values[SORT_TILE];
  local ushort counts[16 * GROUP_SIZE];
  local uint shared[GROUP_SIZE];
  local uint starts[SORT_DIGITS];
  const uint item = get_local_id(0);
  const uint first = get_group_id(0) * SORT_TILE;
  const uint tile_size = min(n - first, (uint)SORT_TILE);
  for (uint j = item; j < SORT_TILE; j += GROUP_SIZE) {
    tile_keys[j] =
        j < tile_size ? keys[first + j] : ~(Key)0;  // surplus sorts behind everything, being last
    tile_values[j] = j < tile_size ? values[first + j] : 0;
  }
  // The tile is loaded.
  barrier(CLK_LOCAL_MEM_FENCE);
  sort_tile_by_nibble(tile_keys, tile_values, counts, shared, shift);
  sort_tile_by_nibble(tile_keys, tile_values, counts, shared, shift + 4);

  // Note where each digit begins in the tile.
  for (uint j = item; j < tile_size; j += GROUP_SIZE) {
    const uint digit = (uint)(tile_keys[j] >> shift) & 255u;
    if (j == 0 || digit != ((uint)(tile_keys[j - 1] >> shift) & 255u)) starts[digit] = j;
  }
  // Each start is written by one item and read by all whose digit it is.
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint j = item; j < tile_size; j += GROUP_SIZE) {
    const uint digit = (uint)(tile_keys[j] >> shift) & 255u;
    const uint place = offsets[digit * get_num_groups(0) + get_group_id(0)] + j - starts[digit];
    keys_out[place] = tile_keys[j];
    values_out[place] = tile_values[j];
  }
}
