// Stable least-significant-digit radix sort of (key, value) pairs that reads and writes every pair
// once a pass (Adinets and Merrill 2022, "Onesweep: A Faster Least Significant Digit Radix Sort for
// GPUs"): the digits of all passes are counted at first; each tile of a pass then learns where its
// digits go from the tiles before it, by look-back (Merrill and Garland 2016). Uses sub_group.cl
// and atomics of device scope. -DKEY_BITS: 32 or 64. -DSWEEP_SUB_GROUPS, -DSWEEP_ITEMS: the tile.

#if KEY_BITS == 64
typedef ulong Key;
#else
typedef uint Key;
#endif
#define SWEEP_GROUP (SWEEP_SUB_GROUPS * SUB_GROUP_SIZE)  // at least SWEEP_DIGITS
#define SWEEP_TILE (SWEEP_GROUP * SWEEP_ITEMS)
#define SWEEP_DIGITS 256
#define NO_TILE 0xffffffffu

// What a tile tells the later ones of one digit: a count, and of what.
#define SWEEP_OF_TILE (1u << 30)     // of this tile
#define SWEEP_UNTIL_TILE (2u << 30)  // of this tile and all before it
#define SWEEP_COUNT (SWEEP_OF_TILE - 1)

/// Counts the digits of all passes. 1D range of 256 * any.
/// @param found, most  [1], nothing is to be done where it is larger than `most`
/// @param bins         [pass_count * SWEEP_DIGITS] in/out: 0 before
kernel void sweep_count(global const Key* restrict keys, const uint n, const uint pass_count,
                        global const int* found, const int most, volatile global uint* bins) {
  local uint counts[KEY_BITS / 8 * SWEEP_DIGITS];
  if (*found > most) return;
  for (uint i = get_local_id(0); i < pass_count * SWEEP_DIGITS; i += get_local_size(0))
    counts[i] = 0;
  // Bins are cleared by one item and counted up by others.
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = get_global_id(0); i < n; i += get_global_size(0)) {
    const Key key = keys[i];
    for (uint pass = 0; pass < pass_count; ++pass)
      atomic_inc(&counts[pass * SWEEP_DIGITS + ((uint)(key >> (8 * pass)) & 255u)]);
  }
  // All items have counted.
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = get_local_id(0); i < pass_count * SWEEP_DIGITS; i += get_local_size(0))
    if (counts[i] != 0) atomic_add(&bins[i], counts[i]);
}

// Exclusive sum over the first SWEEP_DIGITS items; called by all items of the group.
uint scan_digits(local uint* totals, const uint value) {
  const uint sub_group = get_local_id(0) / SUB_GROUP_SIZE;
  const uint sum = sub_group_inclusive_sum(value);
  // The last scan's totals have been read.
  barrier(CLK_LOCAL_MEM_FENCE);
  if (sub_group_lane() == SUB_GROUP_SIZE - 1) totals[sub_group] = sum;
  // All totals are there.
  barrier(CLK_LOCAL_MEM_FENCE);
  uint before = 0;
  for (uint i = 0; i < sub_group; ++i) before += totals[i];
  return before + sum - value;
}

// Tells the later tiles how many pairs of `digit` this one has.
void publish(global atomic_uint* states, const uint tile, const uint digit, const uint count) {
  atomic_store_explicit(&states[tile * SWEEP_DIGITS + digit],
                        (tile > 0 ? SWEEP_OF_TILE : SWEEP_UNTIL_TILE) | count, memory_order_relaxed,
                        memory_scope_device);
}

// Pairs of `digit` in the tiles before `tile`, whose own are `count`; tells the later ones. They
// take their numbers in the order in which they start, so those before are at work or done.
uint look_back(global atomic_uint* states, const uint tile, const uint digit, const uint count) {
  if (tile == 0) return 0;
  uint before = 0;
  for (uint other = tile; other > 0;) {
    const uint state = atomic_load_explicit(&states[(other - 1) * SWEEP_DIGITS + digit],
                                            memory_order_relaxed, memory_scope_device);
    if (state == 0) continue;  // not there yet
    before += state & SWEEP_COUNT;
    if ((state & SWEEP_UNTIL_TILE) != 0) break;
    --other;
  }
  atomic_store_explicit(&states[tile * SWEEP_DIGITS + digit], SWEEP_UNTIL_TILE | (before + count),
                        memory_order_relaxed, memory_scope_device);
  return before;
}

// Places within a tile, two to a word.
uint packed_place(const uint* places, const uint j) {
  return places[j / 2] >> (j % 2 * 16) & 0xffffu;
}

/// Moves all pairs to their places in the order of the digit (key >> shift) & 255. One work-group
/// of SWEEP_GROUP per tile of SWEEP_TILE.
/// @param found, most  as sweep_count
/// @param bins        [SWEEP_DIGITS] counts of this digit
/// @param tiles       [1] in: 0; tiles begun
/// @param states      [tiles * SWEEP_DIGITS] in: 0; used up
/// @param keys_out    [n] out
/// @param values_out  [n] out
kernel __attribute__((reqd_work_group_size(SWEEP_GROUP, 1, 1))) void sweep_pass(
    global const Key* restrict keys, global const uint* restrict values, const uint n,
    const uint shift, global const int* found, const int most, global uint* sweep,
    const uint bins_at, const uint tiles_at, const uint states_at, global Key* restrict keys_out,
    global uint* restrict values_out) {
  local Key tile_keys[SWEEP_TILE];
  local uint counts[SWEEP_SUB_GROUPS * SWEEP_DIGITS];  // then places
  local uint offsets[SWEEP_DIGITS], totals[SWEEP_SUB_GROUPS], shared_tile;
  local uint* tile_values = (local uint*)tile_keys;
  const uint item = get_local_id(0), lane = sub_group_lane();
  const uint sub_group = item / SUB_GROUP_SIZE;
  if (item == 0) {
    const uint next = atomic_inc((volatile global uint*)&sweep[tiles_at]);
    shared_tile = *found > most ? NO_TILE : next;
  }
  for (uint i = item; i < SWEEP_SUB_GROUPS * SWEEP_DIGITS; i += SWEEP_GROUP) counts[i] = 0;
  // The tile is known and the counts are cleared.
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint tile = shared_tile, first = tile * SWEEP_TILE;
  if (tile == NO_TILE) return;
  const uint tile_size = min(n - first, (uint)SWEEP_TILE);

  // Rank each key among those of its sub-group with the same digit: items with equal digits find
  // each other by a vote on each bit.
  Key own[SWEEP_ITEMS];
  uint own_places[SWEEP_ITEMS / 2];  // packed: registers decide how many tiles are worked on
  const uint begin = sub_group * (SUB_GROUP_SIZE * SWEEP_ITEMS) + lane;
#pragma unroll
  for (uint j = 0; j < SWEEP_ITEMS; ++j) {
    const uint place = begin + j * SUB_GROUP_SIZE;
    own[j] = place < tile_size ? keys[first + place] : ~(Key)0;  // surplus is last, and stays so
  }
  local uint* own_counts = counts + sub_group * SWEEP_DIGITS;
#pragma unroll
  for (uint j = 0; j < SWEEP_ITEMS; ++j) {
    const uint digit = (uint)(own[j] >> shift) & 255u;
    uint peers = 0xffffffffu;
#pragma unroll
    for (uint bit = 0; bit < 8; ++bit) {
      const bool set = (digit >> bit & 1) != 0;
      const uint votes = sub_group_vote(set);
      peers &= set ? votes : ~votes;
    }
    const uint lower = popcount(peers & ((1u << lane) - 1));
    const uint before = own_counts[digit];
    // All peers have read the count before the first of them writes.
    sub_group_sync();
    if (lower == 0) own_counts[digit] = before + popcount(peers);
    own_places[j / 2] = j % 2 == 0 ? before + lower : own_places[j / 2] | (before + lower) << 16;
    // It is written before the next keys are ranked.
    sub_group_sync();
  }
  // All sub-groups have counted.
  barrier(CLK_LOCAL_MEM_FENCE);

  // The values are on their way while the tiles before this one count.
  uint own_values[SWEEP_ITEMS];
#pragma unroll
  for (uint j = 0; j < SWEEP_ITEMS; ++j) {
    const uint place = begin + j * SUB_GROUP_SIZE;
    own_values[j] = place < tile_size ? values[first + place] : 0;
  }
  // Where does each digit begin in the tile, in the output, and for each sub-group?
  global atomic_uint* states = (global atomic_uint*)(sweep + states_at);
  uint count = 0, total = 0;
  if (item < SWEEP_DIGITS) {
    for (uint i = 0; i < SWEEP_SUB_GROUPS; ++i) {
      const uint of_sub_group = counts[i * SWEEP_DIGITS + item];
      counts[i * SWEEP_DIGITS + item] = count;
      count += of_sub_group;
    }
    publish(states, tile, item, count);
    total = sweep[bins_at + item];
  }
  const uint start = scan_digits(totals, count);
  const uint output = scan_digits(totals, total);
  if (item < SWEEP_DIGITS) {
    for (uint i = 0; i < SWEEP_SUB_GROUPS; ++i) counts[i * SWEEP_DIGITS + item] += start;
    offsets[item] = output + look_back(states, tile, item, count) - start;
  }
  // Places and offsets are known.
  barrier(CLK_LOCAL_MEM_FENCE);

  // Sort the tile in local memory, so that pairs with equal digits leave side by side.
#pragma unroll
  for (uint j = 0; j < SWEEP_ITEMS; ++j) {
    own_places[j / 2] += own_counts[(uint)(own[j] >> shift) & 255u] << (j % 2 * 16);
    tile_keys[packed_place(own_places, j)] = own[j];
  }
  // The tile's keys are sorted.
  barrier(CLK_LOCAL_MEM_FENCE);
  uint places[SWEEP_ITEMS];
#pragma unroll
  for (uint j = 0; j < SWEEP_ITEMS; ++j) {
    const uint place = item + j * SWEEP_GROUP;
    if (place >= tile_size) continue;
    const Key key = tile_keys[place];
    places[j] = place + offsets[(uint)(key >> shift) & 255u];
    keys_out[places[j]] = key;
  }
  // The keys are out: the values take their room.
  barrier(CLK_LOCAL_MEM_FENCE);
#pragma unroll
  for (uint j = 0; j < SWEEP_ITEMS; ++j) {
    if (begin + j * SUB_GROUP_SIZE < tile_size)
      tile_values[packed_place(own_places, j)] = own_values[j];
  }
  // The tile's values are sorted.
  barrier(CLK_LOCAL_MEM_FENCE);
#pragma unroll
  for (uint j = 0; j < SWEEP_ITEMS; ++j) {
    const uint place = item + j * SWEEP_GROUP;
    if (place < tile_size) values_out[places[j]] = tile_values[place];
  }
}
