// The search for a cheaper treelet (core/cpu/treelet_search.h has the three kinds). Uses treelet.cl.

#if SEARCH != AGGLOMERATIVE

#if SEARCH == KD_TREE
// The part of a subset that goes left at the best of its cuts, and what the parts cost. A cut is
// possible where `separates` holds all leaves before it.
uint best_cut(local const Treelet* treelet, const uint subset,
              local const ushort separates[3][SIZE], float* best) {
  uint best_left = 0;
  *best = INFINITY;
  for (uint axis = 0; axis < 3; ++axis) {
    for (uint i = 1; i < treelet->leaf_count; ++i) {
      if ((subset >> treelet->orders[axis][i] & 1) == 0) continue;
      const uint left = subset & treelet->befores[axis][i];
      if (left == 0 || (left & ~separates[axis][i]) != 0) continue;
      const float parts = treelet->subset_costs[left] + treelet->subset_costs[subset ^ left];
      if (parts < *best) {
        *best = parts;
        best_left = left;
      }
    }
  }
  return best_left;
}
#endif

// The part of a subset that goes left in the cheapest of its partitions, and what the parts cost.
uint best_partition(local const Treelet* treelet, const uint subset, float* best) {
#if SEARCH == KD_TREE
  // Parts that touch are the last resort.
  const uint apart = best_cut(treelet, subset, treelet->belows, best);
  return *best < INFINITY ? apart : best_cut(treelet, subset, treelet->touches, best);
#else
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
#endif
}

void solve_subset(local Treelet* treelet, const uint subset, const TreeletParams params) {
  float3 low = INFINITY, high = -INFINITY;
  uint count = 0;
  for (uint rest = subset; rest != 0; rest &= rest - 1) {
    const uint leaf = 31 - clz(rest & -rest);
    low = fmin(low, part_low(treelet, leaf));
    high = fmax(high, part_high(treelet, leaf));
    count += treelet->counts[leaf];
  }
  float parts;
  bool merged;
  treelet->subset_lefts[subset] = (ushort)best_partition(treelet, subset, &parts);
  treelet->subset_costs[subset] =
      node_cost(measure(low, high, params.measure), count, parts, params, &merged);
}

#if SEARCH == KD_TREE
// Orders the leaves on each axis by (minimum, maximum, index).
void order_leaves(local Treelet* treelet) {
  const uint leaf_count = treelet->leaf_count;
  for (uint task = get_local_id(0); task < 3 * leaf_count; task += get_local_size(0)) {
    const uint axis = task / leaf_count, leaf = task % leaf_count;
    const float low = treelet->lows[axis][leaf], high = treelet->highs[axis][leaf];
    uint place = 0, before = 0, below = 0, touch = 0;
    for (uint i = 0; i < leaf_count; ++i) {
      const float other_low = treelet->lows[axis][i], other_high = treelet->highs[axis][i];
      const bool is_before = other_low < low || (other_low == low && (other_high < high ||
                                                                      (other_high == high && i < leaf)));
      place += is_before ? 1 : 0;
      before |= (is_before ? 1u : 0u) << i;
      below |= (other_high < low ? 1u : 0u) << i;
      touch |= (other_high <= low ? 1u : 0u) << i;
    }
    treelet->orders[axis][place] = (uchar)leaf;
    treelet->befores[axis][place] = (ushort)before;
    treelet->belows[axis][place] = (ushort)below;
    treelet->touches[axis][place] = (ushort)touch;
  }
}
#endif

// Begins the search for the cheapest tree over the leaves, which goes on by solve_size from 2 to
// their number: dynamic programming over their subsets (Karras and Aila 2013, algorithm 2).
void begin_search(local Treelet* treelet) {
#if SEARCH == KD_TREE
  order_leaves(treelet);
#endif
  const uint item = get_local_id(0);
  if (item < treelet->leaf_count) treelet->subset_costs[1u << item] = treelet->costs[item];
}

// Solves the subsets of `size` leaves; the smaller ones are solved.
void solve_size(local Treelet* treelet, const uint size, global const ushort* subsets,
                const TreeletParams params) {
  const uint last = params.subset_ends[size];
  for (uint i = params.subset_ends[size - 1] + get_local_id(0); i < last;
       i += get_local_size(0)) {
    if (subsets[i] < (1u << treelet->leaf_count)) solve_subset(treelet, subsets[i], params);
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

void begin_search(local Treelet* treelet) {}
void solve_size(local Treelet* treelet, const uint size, global const ushort* subsets,
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
