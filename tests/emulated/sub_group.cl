// The functions of core/kernels/sub_group.cl that NVIDIA's PTX has, by exchanges of values among
// the items of work_group.h.

#define SUB_GROUP_SIZE 32
#define EACH_ITEM for (uint i = 0; i < SUB_GROUP_SIZE; ++i)

// What all 32 items call at once with the same `function`, above 1: the values of all of them,
// until the next call.
const uint* emulated_exchange(uint function, uint value);

uint sub_group_lane() { return get_local_id(0) % SUB_GROUP_SIZE; }

void sub_group_sync() { emulated_exchange(2, 0); }

uint sub_group_vote(const bool predicate) {
  const uint* predicates = emulated_exchange(3, predicate);
  uint votes = 0;
  EACH_ITEM votes |= predicates[i] << i;
  return votes;
}

uint sub_group_min(const uint value) {
  const uint* values = emulated_exchange(4, value);
  uint result = values[0];
  EACH_ITEM result = min(result, values[i]);
  return result;
}

uint sub_group_max(const uint value) {
  const uint* values = emulated_exchange(5, value);
  uint result = values[0];
  EACH_ITEM result = max(result, values[i]);
  return result;
}

uint sub_group_add(const uint value) {
  const uint* values = emulated_exchange(6, value);
  uint sum = 0;
  EACH_ITEM sum += values[i];
  return sum;
}

uint sub_group_broadcast(const uint value, const uint from) {
  return emulated_exchange(7, value)[from % SUB_GROUP_SIZE];
}

uint sub_group_exchange(const uint value, const uint mask) {
  return emulated_exchange(8, value)[sub_group_lane() ^ mask];
}
