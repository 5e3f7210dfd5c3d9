// The search for a cheaper treelet (core/cpu/treelet_search.h has the three kinds). Uses treelet.cl.

#if SEARCH != AGGLOMERATIVE

#if SEARCH == KD_TREE
#define ALL_LEAVES (SUBSETS - 1)
#define CUTS (3 * (SIZE - 1))

// The part of a subset that goes left at the best of its cuts, and what the parts cost. Parts that
// touch are the last resort. Where the leaf at a cut is not of the subset, the cut is that before
// its next leaf, or crosses a leaf though that one does not.
uint best_partition(local const Treelet* treelet, const uint subset, const uint* cuts,
                    float* best) {
  const uint members = subset | subset << SIZE | subset << 2 * SIZE;
  float apart = INFINITY, touching = INFINITY;
  uint apart_left = 0, touching_left = 0;
#pragma unroll
  for (uint i = 0; i < CUTS; ++i) {
    const uint cut = cuts[i] & members, left = cut & ALL_LEAVES;
    // A part without leaves costs infinitely much.
    const float parts = treelet->subset_costs[left] + treelet->subset_costs[subset ^ left];
    if (cut <= ALL_LEAVES && parts < apart) {
      apart = parts;
      apart_left = left;
    }
    if (cut < 1u << 2 * SIZE && parts < touching) {
      touching = parts;
      touching_left = left;
    }
  }
  const bool is_apart = apart < INFINITY;
  *best = is_apart ? apart : touching;
  return is_apart ? apart_left : touching_left;
}

// Lists the cuts: leaves are ordered on each axis by (minimum, maximum, index).
void list_cuts(local Treelet* treelet, const uint leaf_count, const uint lane,
               const uint lane_count) {
  for (uint task = lane; task < 3 * SIZE; task += lane_count) {
    const uint axis = task / SIZE, leaf = task % SIZE;
    if (leaf >= leaf_count) {
      treelet->cuts[axis][leaf] = 0;
      continue;
    }
    const float low = treelet->lows[axis][leaf], high = treelet->highs[axis][leaf];
    uint place = 0, before = 0, not_below = 0, over = 0;
    for (uint i = 0; i < leaf_count; ++i) {
      const float other_low = treelet->lows[axis][i], other_high = treelet->highs[axis][i];
      const bool is_before = other_low < low || (other_low == low && (other_high < high ||
                                                                      (other_high == high && i < leaf)));
      if (!is_before) continue;
      ++place;
      before |= 1u << i;
      not_below |= (other_high < low ? 0u : 1u) << i;
      over |= (other_high <= low ? 0u : 1u) << i;
    }
    treelet->cuts[axis][place] = before | not_below << SIZE | over << 2 * SIZE;
  }
}
#else
#define CUTS 1

// The part of a subset that goes left in the cheapest of its partitions, and what the parts cost.
uint best_partition(local const Treelet* treelet, const uint subset, const uint* cuts,
                    float* best) {
  uint best_left = 0;
  *best = INFINITY;
  // All partitions once: `right` goes through the parts without the lowest leaf.
  const uint delta = (subset - 1) & subset;
  for (uint right = -delta & subset; right != 0; right = (right - delta) & subset) {
    const float parts = treelet->subset_costs[subset ^ right] + treelet->subset_costs[right];
    if (parts < *best) {
      *best = parts;
      best_left = subset ^ right;
    }
  }
  return best_left;
}
#endif

// Unites leaves from `first` on, a bit for each in `subset`.
void set_extent(local const Treelet* treelet, const uint first, const uint subset,
                local SubsetExtent* extent) {
  float3 low = INFINITY, high = -INFINITY;
  uint count = 0;
  for (uint rest = subset; rest != 0; rest &= rest - 1) {
    const uint leaf = first + 31 - clz(rest & -rest);
    low = fmin(low, part_low(treelet, leaf));
    high = fmax(high, part_high(treelet, leaf));
    count += treelet->counts[leaf];
  }
  vstore3(low, 0, extent->low);
  vstore3(high, 0, extent->high);
  extent->count = count;
}

void solve_subset(local Treelet* treelet, const uint subset, const uint* cuts,
                  const TreeletParams params) {
  local const SubsetExtent* a = &treelet->low_extents[subset & ((1 << LOW_BITS) - 1)];
  local const SubsetExtent* b = &treelet->high_extents[subset >> LOW_BITS];
  const float3 low = fmin(vload3(0, a->low), vload3(0, b->low));
  const float3 high = fmax(vload3(0, a->high), vload3(0, b->high));
  float parts;
  bool merged;
  treelet->subset_lefts[subset] = (ushort)best_partition(treelet, subset, cuts, &parts);
  treelet->subset_costs[subset] =
      node_cost(measure(low, high, params.measure), a->count + b->count, parts, params, &merged);
}

// Begins the search for the cheapest tree over the leaves, which goes on by solve_size from 2 to
// their number: dynamic programming over their subsets (Karras and Aila 2013, algorithm 2).
// `lane_count` work-items share it.
void begin_search(local Treelet* treelet, const uint leaf_count, const uint lane,
                  const uint lane_count) {
#if SEARCH == KD_TREE
  list_cuts(treelet, leaf_count, lane, lane_count);
#endif
  for (uint i = lane; i < 1 << LOW_BITS; i += lane_count) {
    if (i < 1u << leaf_count) set_extent(treelet, 0, i, &treelet->low_extents[i]);
  }
  for (uint i = lane; i < 1 << HIGH_BITS; i += lane_count) {
    if (i << LOW_BITS < 1u << leaf_count) set_extent(treelet, LOW_BITS, i, &treelet->high_extents[i]);
  }
  if (lane == 0) treelet->subset_costs[0] = INFINITY;
  for (uint i = lane; i < leaf_count; i += lane_count)
    treelet->subset_costs[1u << i] = treelet->costs[i];
}

// Solves the subsets of `size` leaves; the smaller ones are solved.
void solve_size(local Treelet* treelet, const uint leaf_count, const uint size,
                global const ushort* subsets, const uint lane, const uint lane_count,
                const TreeletParams params) {
  uint cuts[CUTS];
#if SEARCH == KD_TREE
#pragma unroll
  for (uint i = 0; i < CUTS; ++i) cuts[i] = treelet->cuts[i / (SIZE - 1)][1 + i % (SIZE - 1)];
#endif
  const uint last = params.subset_ends[size];
  for (uint i = params.subset_ends[size - 1] + lane; i < last; i += lane_count) {
    if (subsets[i] < 1u << leaf_count) solve_subset(treelet, subsets[i], cuts, params);
  }
}

// Hangs the treelet together as was found, for one work-item.
void end_search(local Treelet* treelet, const TreeletParams params) {
  ushort masks[SIZE];
  masks[0] = (ushort)((1u << treelet->leaf_count) - 1);
  uint node_count = 1;
  for (uint node = 0; node < node_count; ++node) {
    const uint subset = masks[node];
    uint left = treelet->subset_lefts[subset];
    if (left == 0) left = subset & -subset;
    for (uint side = 0; side < 2; ++side) {
      const uint part = side == 0 ? left : subset ^ left;
      if ((part & (part - 1)) == 0) {
        treelet->children[side][node] = (uchar)(31 - clz(part));
      } else {
        masks[node_count] = (ushort)part;
        treelet->children[side][node] = (uchar)(SIZE + node_count++);
      }
    }
  }
}

#else

void begin_search(local Treelet* treelet, const uint leaf_count, const uint lane,
                  const uint lane_count) {}
void solve_size(local Treelet* treelet, const uint leaf_count, const uint size,
                global const ushort* subsets, const uint lane, const uint lane_count,
                const TreeletParams params) {}

// Joins the pair whose joint box has the smallest measure until one is left (Domingues and Pedrini
// 2015, section 3.2), for one work-item.
void end_search(local Treelet* treelet, const TreeletParams params) {
  uchar clusters[SIZE];
  uint cluster_count = treelet->leaf_count;
  for (uint i = 0; i < cluster_count; ++i) clusters[i] = (uchar)i;
  // The last joint is the root.
  for (uint node = treelet->leaf_count - 1; node-- > 0;) {
    float best = INFINITY;
    uint left = 0, right = 1;
    for (uint a = 0; a < cluster_count; ++a) {
      const float3 low = part_low(treelet, clusters[a]), high = part_high(treelet, clusters[a]);
      for (uint b = a + 1; b < cluster_count; ++b) {
        const float area = measure(fmin(low, part_low(treelet, clusters[b])),
                                   fmax(high, part_high(treelet, clusters[b])), params.measure);
        if (area < best) {
          best = area;
          left = a;
          right = b;
        }
      }
    }
    const uint a = clusters[left], b = clusters[right];
    treelet->children[0][node] = (uchar)a;
    treelet->children[1][node] = (uchar)b;
    set_part_box(treelet, SIZE + node, fmin(part_low(treelet, a), part_low(treelet, b)),
                 fmax(part_high(treelet, a), part_high(treelet, b)));
    clusters[left] = (uchar)(SIZE + node);
    --cluster_count;
    for (uint i = right; i < cluster_count; ++i) clusters[i] = clusters[i + 1];
  }
}

#endif
