// Leaves: the maximal subtrees of at most B photons, and the photons in leaf order.

#ifndef GROUP_SIZE
#define GROUP_SIZE 256
#endif

// Extends the subtree [*first, *last] to its parent, unless that has more than `cap` photons.
// False: it has, or there is none. `levels`: from boundary `base` on.
bool climb(local const uchar* levels, const uint base, const uint n, const uint cap, uint* first,
           uint* last) {
  const int left = *first > 0 ? (int)levels[*first - 1 - base] : -1;
  const int right = *last + 1 < n ? (int)levels[*last - base] : -1;
  uint a = *first, b = *last;
  // The sibling lies behind the boundary with the larger level and reaches to the next boundary
  // with a smaller one.
  if (left > right) {
    for (--a; a > 0 && levels[a - 1 - base] > left && b - a < cap; --a) {
    }
  } else if (right >= 0) {
    for (++b; b + 1 < n && levels[b - base] > right && b - a < cap; ++b) {
    }
  } else {
    return false;
  }
  if (b - a + 1 > cap) return false;
  *first = a;
  *last = b;
  return true;
}

/// Flags the first photon of each leaf. One work-item per photon and one more, work-groups of
/// GROUP_SIZE.
/// @param levels         [n - 1] split levels
/// @param max_leaf_size  at most kMaxLeafWindow
/// @param flags          [n + 1] out: 1 where a leaf begins, else 0; flags[n] is 0
kernel void leaf_flags(global const uchar* restrict levels, const uint n, const uint max_leaf_size,
                       global uint* restrict flags) {
  // The boundaries that a leaf of a photon of this group can reach, and one more on either side.
  local uchar window[GROUP_SIZE + 2 * (kMaxLeafWindow + 1)];
  const uint begin = get_group_id(0) * GROUP_SIZE, reach = max_leaf_size + 1;
  const uint base = begin > reach ? begin - reach : 0;
  const uint end = min(begin + GROUP_SIZE + reach, n - 1);
  for (uint i = base + get_local_id(0); i < end; i += GROUP_SIZE) window[i - base] = levels[i];
  // All of the window is read by any item.
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint i = get_global_id(0);
  if (i > n) return;
  uint first = i, last = i;
  // A leaf that reaches to the left of i does not begin at i.
  while (i < n && first == i && climb(window, base, n, max_leaf_size, &first, &last)) {
  }
  flags[i] = i < n && first == i ? 1 : 0;
}

/// Lists the first photons of the leaves. One work-item per photon and one more.
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
