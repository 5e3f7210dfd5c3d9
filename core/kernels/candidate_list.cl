// Lists of candidates in local memory, of a sub-group each: cut at a bound, sorted. A candidate is
// (bits of the squared distance, photon index); candidates are ordered by both. Uses sub_group.cl.

#define LIST_ROWS 4  // places of a list / 32
#define LIST_SIZE (LIST_ROWS * SUB_GROUP_SIZE)
#define NOTHING 0xffffffffu  // above the bits of any distance, and no index

bool not_above(const uint2 candidate, const uint bound_d2, const uint bound_id) {
  return candidate.x < bound_d2 || (candidate.x == bound_d2 && candidate.y <= bound_id);
}

// What a cut leaves: candidates not above (d2, id), and how many.
typedef struct Bound {
  float d2;
  uint id, length;
} Bound;

// How many candidates are not above the bound.
uint count_below(const uint2* rows, const uint bound_d2, const uint bound_id) {
  uint count = 0;
  for (uint r = 0; r < LIST_ROWS; ++r) count += not_above(rows[r], bound_d2, bound_id) ? 1 : 0;
  return sub_group_add(count);
}

// Candidates of one item: places lane, 32 + lane, ... of a list.
void load_rows(local const uint2* list, const uint size, uint2* rows) {
  for (uint r = 0; r < LIST_ROWS; ++r) {
    const uint place = r * SUB_GROUP_SIZE + sub_group_lane();
    rows[r] = place < size ? list[place] : (uint2)(NOTHING, NOTHING);
  }
}

// Drops candidates of a list of `size`, more than `most`, until at least `k` and at most `most` are
// left: those not above the bound that it returns. k is at most `most`.
Bound cut_list(const uint size, local uint2* list, const uint k, const uint most) {
  // The list is complete.
  sub_group_sync();
  uint2 rows[LIST_ROWS];
  load_rows(list, size, rows);
  uint largest = 0;
  for (uint r = 0; r < LIST_ROWS; ++r) largest = max(largest, rows[r].x == NOTHING ? 0 : rows[r].x);
  // Up to `low` there are fewer than k, up to `high` at least k.
  uint low = NOTHING, low_count = 0, high = sub_group_max(largest), left = size;
  for (uint step = 0; left > most && high - low > 1; ++step) {  // modulo 2^32: NOTHING is -1
    uint middle = low + (high - low) / 2;
    if ((step & 3) != 3) {
      // As if the distances lay evenly between both.
      const float from = low == NOTHING ? 0.0f : as_float(low);
      const float part = native_divide((k + most) * 0.5f - low_count, (float)(left - low_count));
      middle = as_uint(from + (as_float(high) - from) * part);
      middle = min(max(middle, low + 1), high - 1);
    }
    const uint count = count_below(rows, middle, NOTHING);
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
  for (uint low_id = NOTHING; left > most && high_id - low_id != 1;) {
    const uint middle = low_id + (high_id == low_id ? 0x80000000u : (high_id - low_id) / 2);
    const uint count = count_below(rows, high, middle);
    if (count >= k) {
      high_id = middle;
      left = count;
    } else {
      low_id = middle;
    }
  }
  uint kept = 0;
  const uint before = (1u << sub_group_lane()) - 1;
  for (uint r = 0; r < LIST_ROWS; ++r) {
    const bool stays = rows[r].x != NOTHING && not_above(rows[r], high, high_id);
    const uint votes = sub_group_vote(stays);
    if (stays) list[kept + popcount(votes & before)] = rows[r];
    kept += popcount(votes);
  }
  sub_group_sync();
  return (Bound){as_float(high), high_id, kept};
}

// The smaller of this item's key and that of the item across `mask`; the larger where `bit` is set.
uint smaller_below(const uint own, const uint mask, const uint bit) {
  const uint other = sub_group_exchange(own, mask);
  return (other < own) != ((sub_group_lane() & bit) != 0) ? other : own;
}

// Sorts keys that rise and fall once, or the reverse, over the sub-group.
uint sort_bitonic(uint key) {
  _Pragma("unroll") for (uint bit = 16; bit > 0; bit /= 2) key = smaller_below(key, bit, bit);
  return key;
}

uint sort_row(uint key) {
  _Pragma("unroll") for (uint bit = 1; bit < SUB_GROUP_SIZE; bit *= 2) {
    key = smaller_below(key, 2 * bit - 1, bit);
    _Pragma("unroll") for (uint less = bit / 2; less > 0; less /= 2) key =
        smaller_below(key, less, less);
  }
  return key;
}

// Orders the smaller of two sorted rows, one reversed, into `low`.
void split_rows(uint* low, uint* high) {
  const uint mirrored = sub_group_exchange(*high, SUB_GROUP_SIZE - 1);
  *high = max(*low, mirrored);
  *low = min(*low, mirrored);
}

// The value of the item after this one in a sequence of rows; `row` is the next row.
uint next_of(const uint value, const uint row) {
  const uint after = sub_group_broadcast(value, (sub_group_lane() + 1) % SUB_GROUP_SIZE);
  const uint first = sub_group_broadcast(row, 0);
  return sub_group_lane() == SUB_GROUP_SIZE - 1 ? first : after;
}

// The value of the item before; `row` is the row before.
uint previous_of(const uint value, const uint row) {
  const uint before = sub_group_broadcast(value, (sub_group_lane() - 1) % SUB_GROUP_SIZE);
  const uint last = sub_group_broadcast(row, SUB_GROUP_SIZE - 1);
  return sub_group_lane() == 0 ? last : before;
}

#define KEY_PLACE_BITS 7
#define KEY_PLACES (1u << KEY_PLACE_BITS)
#define KEY_ROWS (KEY_PLACES / SUB_GROUP_SIZE)
#define SORTED_ROWS (LIST_ROWS - 2)

// Sorts a list exactly, whatever it holds, and drops all but the first k.
void rank_list(local uint2* list, uint size, const uint k) {
  if (size > k) size = cut_list(size, list, k, k).length;
  uint2 rows[LIST_ROWS];
  load_rows(list, size, rows);
  uint rank[SORTED_ROWS];
  for (uint r = 0; r < SORTED_ROWS; ++r) rank[r] = 0;
  for (uint i = 0; i < size; ++i) {
    const uint2 other = list[i];
    for (uint r = 0; r < SORTED_ROWS; ++r)
      rank[r] += other.x < rows[r].x || (other.x == rows[r].x && other.y < rows[r].y) ? 1 : 0;
  }
  // All have read the list.
  sub_group_sync();
  for (uint r = 0; r < SORTED_ROWS; ++r)
    if (r * SUB_GROUP_SIZE + sub_group_lane() < size) list[rank[r]] = rows[r];
  sub_group_sync();
}

// Sorts keys in rows: up to as many rows as hold `size`; of more than two rows the upper half only
// where `all`.
void sort_keys(uint* keys, const uint size, const bool all) {
  keys[0] = sort_row(keys[0]);
  if (size <= SUB_GROUP_SIZE) return;
  keys[1] = sort_row(keys[1]);
  split_rows(&keys[0], &keys[1]);
  keys[0] = sort_bitonic(keys[0]);
  keys[1] = sort_bitonic(keys[1]);
  if (size <= 2 * SUB_GROUP_SIZE) return;
  keys[2] = sort_row(keys[2]);
  if (size > 3 * SUB_GROUP_SIZE) {
    keys[3] = sort_row(keys[3]);
    split_rows(&keys[2], &keys[3]);
    keys[2] = sort_bitonic(keys[2]);
    keys[3] = sort_bitonic(keys[3]);
  }
  split_rows(&keys[0], &keys[3]);
  split_rows(&keys[1], &keys[2]);
  const uint low = keys[0], high = keys[3];
  keys[0] = sort_bitonic(min(low, keys[1]));
  keys[1] = sort_bitonic(max(low, keys[1]));
  // The upper half lies in reverse.
  keys[3] = max(high, keys[2]);
  keys[2] = min(high, keys[2]);
  if (!all) return;
  keys[2] = sort_bitonic(keys[2]);
  keys[3] = sort_bitonic(keys[3]);
}

// The first k candidates of a list in order, row by row; behind them anything.
//
// Keys of 25 bits of the distance and 7 of the place are sorted in registers; what has equal bits
// is then put right.
void sort_list(local uint2* list, uint size, const uint k, uint2* sorted) {
  sub_group_sync();
  const uint lane = sub_group_lane(), wanted = min(size, k);
  uint keys[KEY_ROWS], d2[KEY_ROWS], largest = 0;
  for (uint r = 0; r < KEY_ROWS; ++r) {
    const uint place = r * SUB_GROUP_SIZE + lane;
    d2[r] = place < size ? list[place].x : 0;
    largest = max(largest, d2[r]);
  }
  const float to_bits =
      fmin(33550000.0f * native_recip(as_float(sub_group_max(largest))), 1e38f);  // below 2^25
  for (uint r = 0; r < KEY_ROWS; ++r) {
    const uint place = r * SUB_GROUP_SIZE + lane;
    const uint bits = (uint)(as_float(d2[r]) * to_bits);
    keys[r] = place < size ? bits << KEY_PLACE_BITS | place : NOTHING;
  }
  sort_keys(keys, size, k >= KEY_PLACES / 2);
  // Which of the first k have the bits of the next one? Of three in a row the middle one has twice.
  uint twins[SORTED_ROWS], any = 0, runs = 0;
  _Pragma("unroll") for (uint r = 0; r < SORTED_ROWS; ++r) {
    sorted[r] = list[keys[r] % KEY_PLACES];
    const uint next = next_of(keys[r], r + 1 < KEY_ROWS ? keys[r + 1] : NOTHING);
    const uint place = r * SUB_GROUP_SIZE + lane;
    const bool twin = place < wanted && place + 1 < size && (keys[r] ^ next) < KEY_PLACES;
    twins[r] = sub_group_vote(twin);
    // Of the last and what comes behind it, more may have the same bits.
    runs |= sub_group_vote(twin && place + 1 == wanted);
    any |= twins[r];
    runs |= twins[r] & (twins[r] << 1 | (r > 0 ? twins[r - 1] >> 31 : 0));
  }
  if (runs != 0) {
    rank_list(list, size, k);
    for (uint r = 0; r < SORTED_ROWS; ++r) sorted[r] = list[r * SUB_GROUP_SIZE + lane];
  } else if (any != 0) {
    // Two with the same bits each.
    uint2 swapped[SORTED_ROWS];
    _Pragma("unroll") for (uint r = 0; r < SORTED_ROWS; ++r) {
      const uint2 own = sorted[r], row = sorted[(r + 1) % SORTED_ROWS];
      const uint2 row_before = sorted[(r + SORTED_ROWS - 1) % SORTED_ROWS];
      const uint2 next = {next_of(own.x, row.x), next_of(own.y, row.y)};
      const uint2 previous = {previous_of(own.x, row_before.x), previous_of(own.y, row_before.y)};
      const uint second = twins[r] << 1 | (r > 0 ? twins[r - 1] >> 31 : 0);
      swapped[r] = own;
      if ((twins[r] >> lane & 1) != 0 && not_above(next, own.x, own.y)) swapped[r] = next;
      if ((second >> lane & 1) != 0 && !not_above(previous, own.x, own.y)) swapped[r] = previous;
    }
    for (uint r = 0; r < SORTED_ROWS; ++r) sorted[r] = swapped[r];
  }
}
