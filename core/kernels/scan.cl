// Exclusive prefix sum of unsigned numbers in tiles (Blelloch 1990): tiles are scanned alone, their
// sums are scanned in turn, and added.

#ifndef GROUP_SIZE
#define GROUP_SIZE 256
#endif
#ifndef SCAN_ITEMS
#define SCAN_ITEMS 8
#endif
#define SCAN_TILE (GROUP_SIZE * SCAN_ITEMS)

// Exclusive prefix sum of one number per item of a work-group (Hillis and Steele 1986). `total`:
// sum of all.
uint scan_group(local uint* shared, const uint value, uint* total) {
  const uint item = get_local_id(0);
  uint sum = value;
  // What the shared numbers held before is no longer read.
  barrier(CLK_LOCAL_MEM_FENCE);
  shared[item] = sum;
  for (uint reach = 1; reach < GROUP_SIZE; reach *= 2) {
    // The sums of the round before are written ...
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint before = item >= reach ? shared[item - reach] : 0;
    // ... and read, before this round overwrites them.
    barrier(CLK_LOCAL_MEM_FENCE);
    sum += before;
    shared[item] = sum;
  }
  // The last sum is written by the last item and read by all.
  barrier(CLK_LOCAL_MEM_FENCE);
  *total = shared[GROUP_SIZE - 1];
  return sum - value;
}

/// Scans each tile of SCAN_TILE numbers by one work-group of GROUP_SIZE.
/// @param values  [n] in/out: numbers, then their exclusive sums within the tile
/// @param sums    [tiles] out: sum of each tile
kernel void scan_tiles(global uint* restrict values, const uint n, global uint* restrict sums) {
  local uint shared[GROUP_SIZE];
  const uint first = get_group_id(0) * SCAN_TILE + get_local_id(0) * SCAN_ITEMS;
  uint numbers[SCAN_ITEMS];
  uint sum = 0;
  for (uint j = 0; j < SCAN_ITEMS; ++j) {
    numbers[j] = first + j < n ? values[first + j] : 0;
    sum += numbers[j];
  }
  uint total;
  uint before = scan_group(shared, sum, &total);
  for (uint j = 0; j < SCAN_ITEMS; ++j) {
    if (first + j < n) values[first + j] = before;
    before += numbers[j];
  }
  if (get_local_id(0) == 0) sums[get_group_id(0)] = total;
}

/// Adds to each tile what comes before it; ranges as scan_tiles.
/// @param values  [n] in/out
/// @param sums    [tiles] exclusive sum of the tiles before each
kernel void scan_add(global uint* restrict values, const uint n, global const uint* restrict sums) {
  const uint first = get_group_id(0) * SCAN_TILE;
  const uint sum = sums[get_group_id(0)];
  for (uint j = get_local_id(0); j < SCAN_TILE && first + j < n; j += GROUP_SIZE)
    values[first + j] += sum;
}
