// Short runs of equal codes, rebuilt by one sub-group each in local memory: what ties.cl does in
// some ten launches for all runs. A run that one round of finer codes does not tell apart is left
// to ties.cl. Uses morton.cl, ties.cl and sub_group.cl. -DSUB_GROUPS: of one work-group.
// -DTIE_SHORT_RUN: photons of a run, a power of two. -DTIE_BOUNDARIES: that one item looks at.

// Sorts `size` numbers, a power of two, in ascending order (Batcher 1968, bitonic sort).
void sort_bitonic(local ulong* numbers, const uint size) {
  for (uint span = 2; span <= size; span *= 2) {
    for (uint step = span / 2; step > 0; step /= 2) {
      // The round before is written.
      sub_group_sync();
      for (uint i = sub_group_lane(); i < size / 2; i += SUB_GROUP_SIZE) {
        const uint low = 2 * i - (i & (step - 1)), high = low + step;
        const ulong a = numbers[low], b = numbers[high];
        if ((a > b) == ((low & span) == 0)) {
          numbers[low] = b;
          numbers[high] = a;
        }
      }
    }
  }
  sub_group_sync();
}

// Photons of the run of equal codes that begins at `first`, counted up to TIE_SHORT_RUN + 1.
uint run_length(global const uchar* levels, const uint n, const uint first) {
  uint length = 1;
  while (length <= TIE_SHORT_RUN) {
    const uint boundary = first + length - 1 + sub_group_lane();
    const uint tied = sub_group_vote(boundary + 1 < n && levels[boundary] == kLevelTied);
    if (tied != 0xffffffffu) return length + ctz(~tied);
    length += SUB_GROUP_SIZE;
  }
  return length;
}

// Rebuilds the run. False: it is left as it was, since one round does not do.
bool rebuild_run(global const float* restrict positions, const uint first, const uint length,
                 const uint max_leaf_size, const uint base, local ulong* keys, global uint* ids,
                 global uchar* levels) {
  const uint lane = sub_group_lane();
  uint box[6] = {0xffffffffu, 0xffffffffu, 0xffffffffu, 0, 0, 0};
  for (uint i = lane; i < length; i += SUB_GROUP_SIZE) {
    const float3 p = load_position(positions, ids[first + i]);
    const uint bits[3] = {ordered_bits(p.x), ordered_bits(p.y), ordered_bits(p.z)};
    for (uint c = 0; c < 3; ++c) {
      box[c] = min(box[c], bits[c]);
      box[3 + c] = max(box[3 + c], bits[c]);
    }
  }
  float low[3], extent[3];
  for (uint c = 0; c < 3; ++c) {
    low[c] = from_ordered_bits(sub_group_min(box[c]));
    extent[c] = from_ordered_bits(sub_group_max(box[3 + c])) - low[c];
  }
  const bool same = extent[0] == 0 && extent[1] == 0 && extent[2] == 0;
  const MortonGrid grid = grid_of(vload3(0, low), vload3(0, extent));

  // Equal codes stay in the order of their indices, as after a stable sort.
  uint size = SUB_GROUP_SIZE;
  while (size < length) size *= 2;
  for (uint i = lane; i < size; i += SUB_GROUP_SIZE) {
    const uint id = i < length ? ids[first + i] : 0;
    keys[i] =
        i < length ? (ulong)morton_code_30(load_position(positions, id), grid) << 32 | id : ~0ul;
  }
  if (!same) sort_bitonic(keys, size);
  bool tied = false;
  for (uint i = lane; i + max_leaf_size < length; i += SUB_GROUP_SIZE)
    tied |= !same && (uint)(keys[i] >> 32) == (uint)(keys[i + max_leaf_size] >> 32);
  if (sub_group_vote(tied) != 0) return false;

  for (uint i = lane; i < length; i += SUB_GROUP_SIZE) {
    if (!same) ids[first + i] = (uint)keys[i];
    if (i + 1 == length) continue;
    const uint difference = (uint)(keys[i] >> 32) ^ (uint)(keys[i + 1] >> 32);
    levels[first + i] = (uchar)(same              ? kLevelSame
                                : difference == 0 ? kLevelTied
                                                  : base + clz(difference) - (32 - kTieBits));
  }
  return true;
}

/// Rebuilds all short runs. One work-item per TIE_BOUNDARIES boundaries.
/// @param base    level of the first bit of the finer codes: levels from there on are within runs
/// @param ids     [n] in/out: photon at each place of the leaf order
/// @param levels  [n - 1] in/out
/// @param rest    [1] out: not 0 where a run is left for ties.cl; 0 before
kernel void tie_short_runs(global const float* restrict positions, const uint n,
                           const uint max_leaf_size, const uint base, global uint* ids,
                           global uchar* levels, global uint* rest) {
  local ulong all_keys[SUB_GROUPS * TIE_SHORT_RUN];
  local ulong* keys = all_keys + get_local_id(0) / SUB_GROUP_SIZE % SUB_GROUPS * TIE_SHORT_RUN;
  const uint begin = get_global_id(0) / SUB_GROUP_SIZE * SUB_GROUP_SIZE * TIE_BOUNDARIES;
  for (uint step = 0; step < TIE_BOUNDARIES; ++step) {
    const uint i = begin + step * SUB_GROUP_SIZE + sub_group_lane();
    // A run's boundaries may be rewritten at any time by whom it belongs to, the sub-group of its
    // first one; they stay at or above `base`.
    const bool head = i + 1 < n && levels[i] == kLevelTied && (i == 0 || levels[i - 1] < base);
    for (uint heads = sub_group_vote(head); heads != 0; heads &= heads - 1) {
      const uint first = i - sub_group_lane() + ctz(heads);
      const uint length = run_length(levels, n, first);
      if (length <= min(max_leaf_size, (uint)TIE_SHORT_RUN)) continue;
      // Of a longer run only ties.cl knows whether it is longer than a leaf.
      const bool done =
          length <= TIE_SHORT_RUN &&
          rebuild_run(positions, first, length, max_leaf_size, base, keys, ids, levels);
      if (!done && sub_group_lane() == 0) rest[0] = 1;  // all writers write the same
      // The keys have been read.
      sub_group_sync();
    }
  }
}
