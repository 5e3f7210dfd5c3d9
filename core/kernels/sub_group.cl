// Sub-groups: 32 work-items in step that vote, reduce and shuffle. NVIDIA's compiler lacks OpenCL's
// own functions for that and takes PTX. Every function is called by all 32 items at once.

#define SUB_GROUP_SIZE 32

uint sub_group_lane() { return (uint)get_local_id(0) & (SUB_GROUP_SIZE - 1); }

// Makes writes to local memory by one item of the sub-group visible to the others.
void sub_group_sync() { asm volatile("bar.warp.sync 0xffffffff;" : : : "memory"); }

// Bit i: the predicate of item i.
uint sub_group_vote(const bool predicate) {
  uint votes;
  asm volatile("{ .reg .pred p; setp.ne.u32 p, %1, 0; vote.sync.ballot.b32 %0, p, 0xffffffff; }"
               : "=r"(votes)
               : "r"((uint)predicate));
  return votes;
}

uint sub_group_min(const uint value) {
  uint result;
  asm volatile("redux.sync.min.u32 %0, %1, 0xffffffff;" : "=r"(result) : "r"(value));
  return result;
}

uint sub_group_max(const uint value) {
  uint result;
  asm volatile("redux.sync.max.u32 %0, %1, 0xffffffff;" : "=r"(result) : "r"(value));
  return result;
}

uint sub_group_add(const uint value) {
  uint result;
  asm volatile("redux.sync.add.u32 %0, %1, 0xffffffff;" : "=r"(result) : "r"(value));
  return result;
}

// The value of item `from`.
uint sub_group_broadcast(const uint value, const uint from) {
  uint result;
  asm volatile("shfl.sync.idx.b32 %0, %1, %2, 31, 0xffffffff;"
               : "=r"(result)
               : "r"(value), "r"(from));
  return result;
}

// The value of the item whose lane differs from this one's by the bits of `mask`.
uint sub_group_exchange(const uint value, const uint mask) {
  uint result;
  asm volatile("shfl.sync.bfly.b32 %0, %1, %2, 31, 0xffffffff;"
               : "=r"(result)
               : "r"(value), "r"(mask));
  return result;
}

// Sums over the sub-group, each added in the order of a butterfly: item 0 gets that of x, 1 of y, 2
// of z.
float sub_group_sum_each(const float3 value) {
  const uint lane = sub_group_lane();
  const bool odd = (lane & 1) != 0, second = (lane & 2) != 0;
  // Even items go on with x and z, odd ones with y; of the even ones each other with z.
  const float received = as_float(sub_group_exchange(as_uint(odd ? value.x : value.y), 1));
  const float z = value.z + as_float(sub_group_exchange(as_uint(value.z), 1));
  const float own = (odd ? value.y : value.x) + received;
  const float given = odd ? own : second ? own : z;
  float sum = (!odd && second ? z : own) + as_float(sub_group_exchange(as_uint(given), 2));
  for (uint step = 4; step < SUB_GROUP_SIZE; step *= 2)
    sum += as_float(sub_group_exchange(as_uint(sum), step));
  return sum;
}

// Sum of the values of this item and of those before it.
uint sub_group_inclusive_sum(uint value) {
  for (uint step = 1; step < SUB_GROUP_SIZE; step *= 2) {
    const uint before = sub_group_broadcast(value, sub_group_lane() - step);
    if (sub_group_lane() >= step) value += before;
  }
  return value;
}
