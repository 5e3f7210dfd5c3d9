// Lists of candidates too long for the registers of a sub-group: cut at a bound, sorted, all in
// local memory. A candidate is one number that orders by (squared distance, photon index). Uses
// traverse.cl and sub_group.cl.

#define NOTHING 0xffffffffu  // above the bits of any distance, and not below any index

// Bits of the items of the sub-group before this one.
uint items_before() { return (1u << sub_group_lane()) - 1; }

// How many candidates are not above the bound.
uint count_not_above(local const ulong* list, const uint size, const ulong bound) {
  uint count = 0;
  _Pragma("unroll 4") for (uint i = sub_group_lane(); i < size; i += SUB_GROUP_SIZE) count +=
      list[i] <= bound ? 1 : 0;
  return sub_group_add(count);
}

// The bits of the largest squared distance of a list; 0 of an empty one.
uint largest_distance(local const ulong* list, const uint size) {
  uint largest = 0;
  for (uint i = sub_group_lane(); i < size; i += SUB_GROUP_SIZE)
    largest = max(largest, (uint)(list[i] >> 32));
  return sub_group_max(largest);
}

// A bound that at least `k` and at most `most` candidates of a list of `size`, more than `most`,
// are not above. k is at most `most`.
ulong find_bound(local const ulong* list, const uint size, const uint k, const uint most) {
  // Up to `low` there are fewer than k, up to `high` at least k.
  uint low = 0xffffffffu, low_count = 0, high = largest_distance(list, size), left = size;
  for (uint step = 0; left > most && high - low > 1; ++step) {  // modulo 2^32: low is -1 at first
    uint middle = low + (high - low) / 2;
    if ((step & 3) != 3) {
      // As if the distances lay evenly between both.
      const float from = low == 0xffffffffu ? 0.0f : as_float(low);
      const float part = native_divide((k + most) * 0.5f - low_count, (float)(left - low_count));
      middle = as_uint(from + (as_float(high) - from) * part);
      middle = min(max(middle, low + 1), high - 1);
    }
    const uint count = count_not_above(list, size, (ulong)middle << 32 | NOTHING);
    if (count >= k) {
      high = middle;
      left = count;
    } else {
      low = middle;
      low_count = count;
    }
  }
  // Of equal distances take the smallest indices.
  uint high_id = NOTHING;
  for (uint low_id = 0xffffffffu; left > most && high_id - low_id != 1;) {
    const uint middle = low_id + (high_id == low_id ? 0x80000000u : (high_id - low_id) / 2);
    const uint count = count_not_above(list, size, (ulong)high << 32 | middle);
    if (count >= k) {
      high_id = middle;
      left = count;
    } else {
      low_id = middle;
    }
  }
  return (ulong)high << 32 | high_id;
}

// Drops the candidates above the bound; returns how many are left.
uint drop_above(local ulong* list, const uint size, const ulong bound) {
  uint kept = 0;
  for (uint row = 0; row < size; row += SUB_GROUP_SIZE) {
    const uint place = row + sub_group_lane();
    const ulong value = place < size ? list[place] : ~(ulong)0;
    const bool stays = value <= bound;
    // All have read the row, and what is written lies before its end.
    const uint votes = sub_group_vote(stays);
    if (stays) list[kept + popcount(votes & items_before())] = value;
    kept += popcount(votes);
  }
  sub_group_sync();
  return kept;
}

// Puts the smaller of two candidates first; behind the list there is nothing to put.
void order_pair(local ulong* list, const uint size, const uint first, const uint second) {
  if (second >= size) return;
  const ulong a = list[first], b = list[second];
  if (a <= b) return;
  list[first] = b;
  list[second] = a;
}

// Sorts a list: a bitonic network in which the smaller always comes first (Batcher 1968).
void sort_long_list(local ulong* list, const uint size) {
  for (uint half_width = 1; half_width < size; half_width *= 2) {
    // Two sorted halves, the second read backwards ...
    for (uint i = sub_group_lane(); i < size; i += SUB_GROUP_SIZE) {
      const uint first = 2 * i - (i & (half_width - 1));
      order_pair(list, size, first, first ^ (2 * half_width - 1));
    }
    sub_group_sync();
    // ... become halves of halves.
    for (uint gap = half_width / 2; gap > 0; gap /= 2) {
      for (uint i = sub_group_lane(); i < size; i += SUB_GROUP_SIZE) {
        const uint first = 2 * i - (i & (gap - 1));
        order_pair(list, size, first, first + gap);
      }
      sub_group_sync();
    }
  }
}

// A list in bins of its squared distances: `members` are places of the list, bin by bin, those of
// bin b from ends[b - 1] to ends[b], in any order. In the local memory behind the list.
typedef struct Bins {
  local uint* ends;
  local ushort* members;
  float to_bin;
  uint count;  // 0: the list is not in bins
} Bins;

#define LARGEST_BIN 48

uint bin_of(const Bins bins, const ulong value) {
  return min((uint)(as_float((uint)(value >> 32)) * bins.to_bin), bins.count - 1);
}

uint bin_begin(const Bins bins, const uint bin) { return bin > 0 ? bins.ends[bin - 1] : 0; }

// Distributes a list of `size`, with space for `capacity`, over about half as many bins. No bins
// where one would hold too much, or where there is no space for them.
Bins make_bins(local ulong* list, const uint size, const uint capacity) {
  const uint lane = sub_group_lane(), words = 2 * (capacity - size) - (size + 1) / 2;
  Bins bins = {(local uint*)(list + size), 0, 0.0f, 0};
  if (2 * (capacity - size) < (size + 1) / 2 + SUB_GROUP_SIZE) return bins;
  const uint wanted = size / 2 / SUB_GROUP_SIZE * SUB_GROUP_SIZE + SUB_GROUP_SIZE;
  bins.count = min(wanted, words / SUB_GROUP_SIZE * SUB_GROUP_SIZE);
  bins.members = (local ushort*)(bins.ends + bins.count);
  const float largest = as_float(largest_distance(list, size));
  bins.to_bin = fmin(native_divide((float)bins.count, largest), 1e38f);
  for (uint i = lane; i < bins.count; i += SUB_GROUP_SIZE) bins.ends[i] = 0;
  sub_group_sync();
  for (uint i = lane; i < size; i += SUB_GROUP_SIZE) atomic_inc(bins.ends + bin_of(bins, list[i]));
  sub_group_sync();
  uint before = 0, most = 0;
  for (uint i = lane; i < bins.count; i += SUB_GROUP_SIZE) {
    const uint own = bins.ends[i], sum = sub_group_inclusive_sum(own);
    bins.ends[i] = before + sum - own;
    before += sub_group_broadcast(sum, SUB_GROUP_SIZE - 1);
    most = max(most, own);
  }
  sub_group_sync();
  if (sub_group_max(most) > LARGEST_BIN) {
    bins.count = 0;
    return bins;
  }
  // Where each bin begins becomes where it ends.
  for (uint i = lane; i < size; i += SUB_GROUP_SIZE)
    bins.members[atomic_inc(bins.ends + bin_of(bins, list[i]))] = i;
  sub_group_sync();
  return bins;
}

// The place of a candidate among all of the list in order.
uint rank_in_bins(const Bins bins, local const ulong* list, const ulong value) {
  const uint bin = bin_of(bins, value), begin = bin_begin(bins, bin), end = bins.ends[bin];
  uint rank = begin;
  for (uint i = begin; i < end; ++i) rank += list[bins.members[i]] < value ? 1 : 0;
  return rank;
}
