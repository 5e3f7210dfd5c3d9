// Leaves: the maximal subtrees of at most B photons, and the photons in leaf order. A leaf begins
// behind each boundary whose node is larger. Uses large_subtree.cl.

#ifndef GROUP_SIZE
#define GROUP_SIZE 256
#endif

/// Marks the first photon of each leaf. One work-item per photon, work-groups of GROUP_SIZE, a
/// multiple of 32.
/// @param levels         [n - 1] split levels
/// @param max_leaf_size  at most kMaxLeafWindow
/// @param is_tied        [1]
/// @param marks          [groups * GROUP_SIZE / 32] out: a bit for each photon, 1 where a leaf
/// begins
/// @param counts         [groups + 2] out: leaves that begin in each group, 0, and `is_tied`, which
/// the host reads with their sum
kernel void leaf_marks(global const uchar* restrict levels, const uint n, const uint max_leaf_size,
                       global const uint* restrict is_tied, global uint* restrict marks,
                       global uint* restrict counts) {
  // The boundaries that a leaf of a photon of this group can reach, and one more on either side.
  local uchar window[GROUP_SIZE + 2 * (kMaxLeafWindow + 1)];
  local uint words[GROUP_SIZE / 32], count;
  const uint item = get_local_id(0), group = get_group_id(0);
  const uint begin = group * GROUP_SIZE, reach = max_leaf_size + 1;
  const uint base = begin > reach ? begin - reach : 0;
  const uint end = min(begin + GROUP_SIZE + reach, n - 1);
  for (uint i = base + item; i < end; i += GROUP_SIZE) window[i - base] = levels[i];
  if (item < GROUP_SIZE / 32) words[item] = 0;
  if (item == 0) count = 0;
  // All of the window is read by any item; the words are 0 before bits are set.
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint i = begin + item;
  if (i < n && (i == 0 || is_large(window, base, i - 1, n, max_leaf_size)))
    atomic_or(&words[item / 32], 1u << item % 32);
  // All bits are set.
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item < GROUP_SIZE / 32) {
    marks[group * (GROUP_SIZE / 32) + item] = words[item];
    atomic_add(&count, popcount(words[item]));
  }
  // All words are counted.
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0) {
    counts[group] = count;
    if (group + 1 == get_num_groups(0)) {
      counts[group + 1] = 0;
      counts[group + 2] = *is_tied;
    }
  }
}

/// Lists the marked photons; ranges as leaf_marks.
/// @param counts  [groups + 1] exclusive sum
/// @param firsts  [leaf_count + 1] out: first photon of each leaf, then n
kernel void marked_firsts(global const uint* restrict marks, global const uint* restrict counts,
                          const uint n, global uint* restrict firsts) {
  const uint item = get_local_id(0), group = get_group_id(0), i = group * GROUP_SIZE + item;
  global const uint* words = marks + group * (GROUP_SIZE / 32);
  if (i == 0) firsts[counts[get_num_groups(0)]] = n;
  if ((words[item / 32] >> item % 32 & 1) == 0) return;
  uint place = counts[group] + popcount(words[item / 32] & ((1u << item % 32) - 1));
  for (uint word = 0; word < item / 32; ++word) place += popcount(words[word]);
  firsts[place] = i;
}

/// Lists the photons that a leaf begins with, from flags. One work-item per photon and one more.
/// @param places       [n + 1] exclusive sum of the flags
/// @param leaf_firsts  [leaf_count + 1] out: first photon of each leaf, then n
kernel void leaf_firsts(global const uint* restrict places, const uint n,
                        global uint* restrict firsts) {
  const uint i = get_global_id(0);
  if (i > n) return;
  if (i == n || places[i] != places[i + 1]) firsts[places[i]] = i;
}

/// Copies the photons to leaf order. One work-item per photon.
/// @param ids      [n] photon at each place
/// @param photons  [n] out
kernel void leaf_photons(global const float* restrict positions, global const uint* restrict ids,
                         const uint n, global LeafPhoton* restrict photons) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float3 p = load_position(positions, ids[i]);
  vstore4((float4)(p, as_float(ids[i])), i, (global float*)photons);
}
