// One round of treelet restructuring (Karras and Aila 2013; core/cpu/treelet.h says how we differ):
// bottom-up from the leaves of a tree, the second of two siblings to come carries on. A work-group
// of 32 brings 32 leaves up; where one of its work-items comes to the root of a treelet, all work on
// it. Uses meeting.cl and measure.cl.
// -DTREELET_SIZE: leaves of a treelet at most. -DSEARCH: KD_TREE, BVH or AGGLOMERATIVE.

#define KD_TREE 0
#define BVH 1
#define AGGLOMERATIVE 2

#define SIZE TREELET_SIZE
#define SUBSETS (1 << SIZE)
#define NONE 0xffffffffu

typedef struct Treelet {
  // Its parts: leaves, then from SIZE on the nodes, the root first and parents before children.
  float lows[3][2 * SIZE], highs[3][2 * SIZE];
  float costs[2 * SIZE];
  uint counts[2 * SIZE];       // photons
  uint leaf_counts[2 * SIZE];  // of the tree
  uint heights[2 * SIZE];
  uint links[SIZE];  // of the leaves
  uint nodes[SIZE];  // of the tree
  uint leaf_count;
  // How they hang together: the parts on the left and right of each node.
  uchar children[2][SIZE];
  // While it grows: what each leaf hangs on, 2 * node + side, and how much it asks to be divided.
  uchar owners[SIZE];
  float priorities[SIZE];
  uint raw[22];  // a Node and its NodeCosts
  uint next;     // leaf that is divided next, or NONE
#if SEARCH != AGGLOMERATIVE
  float subset_costs[SUBSETS];
  ushort subset_lefts[SUBSETS];  // 0: there is no cut
#endif
#if SEARCH == KD_TREE
  uchar orders[3][SIZE];    // leaves on each axis
  ushort befores[3][SIZE];  // leaves before each place of the order
  ushort touches[3][SIZE];  // leaves that end where the leaf at the place begins, or before
  ushort belows[3][SIZE];   // leaves that end before it
#endif
} Treelet;

bool may_merge(const uint count, const TreeletParams params) {
  return params.merges != 0 && count <= params.max_leaf_size;
}

float leaf_cost(const float area, const uint count) { return area * (1.0f + 0.2f * (float)count); }

// TreeletCost::Node of core/cpu/treelet_search.h.
float node_cost(const float area, const uint count, const float parts, const TreeletParams params,
                bool* merged) {
  const float inner = area + parts;
  *merged = false;
  if (!may_merge(count, params)) return inner;
  const float leaf = leaf_cost(area, count);
  *merged = leaf <= inner;
  return *merged ? leaf : inner;
}

// What two siblings cost together: infinitely much where they may not be siblings.
float parts_cost(const float left_cost, const float3 left_low, const float3 left_high,
                 const float right_cost, const float3 right_low, const float3 right_high) {
#if SEARCH == KD_TREE
  if (!any(left_high <= right_low) && !any(right_high <= left_low)) return INFINITY;
#endif
  return left_cost + right_cost;
}

float3 part_low(local const Treelet* treelet, const uint part) {
  return (float3)(treelet->lows[0][part], treelet->lows[1][part], treelet->lows[2][part]);
}

float3 part_high(local const Treelet* treelet, const uint part) {
  return (float3)(treelet->highs[0][part], treelet->highs[1][part], treelet->highs[2][part]);
}

void set_part_box(local Treelet* treelet, const uint part, const float3 low, const float3 high) {
  treelet->lows[0][part] = low.x;
  treelet->lows[1][part] = low.y;
  treelet->lows[2][part] = low.z;
  treelet->highs[0][part] = high.x;
  treelet->highs[1][part] = high.y;
  treelet->highs[2][part] = high.z;
}

// Copies the node of the leaf that is divided next; it becomes number `node` of the treelet.
void load_node(local Treelet* treelet, const uint node, global const Node* nodes,
               global const NodeCosts* costs) {
  const uint item = get_local_id(0);
  const uint index = treelet->nodes[node];
  if (item < 16) treelet->raw[item] = ((global const uint*)(nodes + index))[item];
  if (item >= 16 && item < 22) treelet->raw[item] = ((global const uint*)(costs + index))[item - 16];
}

// Makes its child on `side` a leaf, in the place of the one that is divided or behind all others.
void take_leaf(local Treelet* treelet, const uint side, const uint node,
               const TreeletParams params) {
  const uint leaf = side == 0 ? treelet->next : treelet->leaf_count;
  if (side == 0 && node > 0) {
    const uint owner = treelet->owners[leaf];
    treelet->children[owner % 2][owner / 2] = (uchar)(SIZE + node);
  }
  local const uint* raw = treelet->raw;
  const float3 low = as_float3((uint3)(raw[6 * side], raw[6 * side + 1], raw[6 * side + 2]));
  const float3 high = as_float3((uint3)(raw[6 * side + 3], raw[6 * side + 4], raw[6 * side + 5]));
  set_part_box(treelet, leaf, low, high);
  const uint link = raw[12 + side], count = raw[14 + side];
  treelet->links[leaf] = link;
  treelet->counts[leaf] = count;
  treelet->costs[leaf] = as_float(raw[16 + side]);
  treelet->leaf_counts[leaf] = raw[18 + side];
  treelet->heights[leaf] = raw[20 + side];
  treelet->owners[leaf] = (uchar)(2 * node + side);
  treelet->priorities[leaf] = (link & kLeafBit) != 0  ? -1.0f
                              : params.round % 2 == 0 ? measure(low, high, params.measure)
                                                      : (float)count;
}

// Chooses the leaf that is divided next, if any; `node` is the last that was divided.
void choose_leaf(local Treelet* treelet, const uint node) {
  const uint leaf_count = ++treelet->leaf_count;
  treelet->next = NONE;
  if (leaf_count == SIZE) return;
  float priority = -1;
  for (uint i = 0; i < leaf_count; ++i) {
    if (treelet->priorities[i] <= priority) continue;
    priority = treelet->priorities[i];
    treelet->next = i;
    treelet->nodes[node + 1] = treelet->links[i];
  }
}

// Computes what is known of the nodes from their children, for one work-item.
void assemble(local Treelet* treelet, const TreeletParams params) {
  for (uint node = treelet->leaf_count - 1; node-- > 0;) {
    const uint left = treelet->children[0][node], right = treelet->children[1][node];
    const uint part = SIZE + node;
    const float3 left_low = part_low(treelet, left), left_high = part_high(treelet, left);
    const float3 right_low = part_low(treelet, right), right_high = part_high(treelet, right);
    const float3 low = fmin(left_low, right_low), high = fmax(left_high, right_high);
    set_part_box(treelet, part, low, high);
    const uint count = treelet->counts[left] + treelet->counts[right];
    treelet->counts[part] = count;
    treelet->leaf_counts[part] = treelet->leaf_counts[left] + treelet->leaf_counts[right];
    const float parts = parts_cost(treelet->costs[left], left_low, left_high,
                                   treelet->costs[right], right_low, right_high);
    bool merged;
    treelet->costs[part] =
        node_cost(measure(low, high, params.measure), count, parts, params, &merged);
    const uint height =
        max(treelet->heights[left] & ~kMergedBit, treelet->heights[right] & ~kMergedBit) + 1;
    treelet->heights[part] = height | (merged ? kMergedBit : 0);
  }
}

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

// Writes the nodes of the treelet back.
void store(local const Treelet* treelet, global Node* nodes, global NodeCosts* costs,
           global uint* parents, global uint* leaf_parents, const TreeletParams params) {
  const uint node = get_local_id(0);
  if (node + 1 >= treelet->leaf_count) return;
  const uint index = treelet->nodes[node];
  Node out;
  NodeCosts out_costs;
  uint links[2], counts[2];
  for (uint side = 0; side < 2; ++side) {
    const uint part = treelet->children[side][node];
    const uint link = part < SIZE ? treelet->links[part] : treelet->nodes[part - SIZE];
    links[side] = link;
    counts[side] = treelet->counts[part];
    if ((link & kLeafBit) != 0) {
      leaf_parents[link & ~kLeafBit] = 2 * index + side;
    } else {
      parents[link] = 2 * index + side;
    }
    out_costs.costs[side] = may_merge(counts[side], params) ? treelet->costs[part] : 0.0f;
    out_costs.leaf_counts[side] = treelet->leaf_counts[part];
    out_costs.heights[side] = treelet->heights[part];
  }
  const uint left = treelet->children[0][node], right = treelet->children[1][node];
  vstore3(part_low(treelet, left), 0, out.left_min);
  vstore3(part_high(treelet, left), 0, out.left_max);
  vstore3(part_low(treelet, right), 0, out.right_min);
  vstore3(part_high(treelet, right), 0, out.right_max);
  out.left = links[0];
  out.right = links[1];
  out.left_count = counts[0];
  out.right_count = counts[1];
  nodes[index] = out;
  costs[index] = out_costs;
}

// A finished subtree on its way up.
typedef struct Climber {
  uint slot;  // 2 * node above + side, or kNoSlot: it is the whole tree
  uint leaf_count, height;
  float cost;
} Climber;

// Brings a finished subtree up to where another has to come first, or to the root of a treelet,
// which is returned, with the climber what that is as it stands.
uint climb(Climber* climber, volatile global Meeting* meetings, global const Node* nodes,
           global NodeCosts* costs, global const uint* parents, global uint* root_height,
           const TreeletParams params) {
  while (climber->slot != kNoSlot) {
    const uint index = climber->slot / 2, side = climber->slot % 2;
    costs[index].costs[side] = climber->cost;
    costs[index].leaf_counts[side] = climber->leaf_count;
    costs[index].heights[side] = climber->height;
    // This item wrote what is below on its side and releases it; the second to come acquires the
    // other's.
    if (EXCHANGE(&meetings[index], params.round + 1) != params.round + 1) return NONE;
    global const Node* node = nodes + index;
    const uint count = node->left_count + node->right_count;
    const uint other_height = costs[index].heights[!side];
    climber->leaf_count += costs[index].leaf_counts[!side];
    climber->height = max(climber->height & ~kMergedBit, other_height & ~kMergedBit) + 1;
    climber->cost = 0;
    if (may_merge(count, params)) {
      const float3 left_low = vload3(0, node->left_min), left_high = vload3(0, node->left_max);
      const float3 right_low = vload3(0, node->right_min), right_high = vload3(0, node->right_max);
      const float parts = parts_cost(costs[index].costs[0], left_low, left_high,
                                     costs[index].costs[1], right_low, right_high);
      bool merged;
      climber->cost = node_cost(
          measure(fmin(left_low, right_low), fmax(left_high, right_high), params.measure), count,
          parts, params, &merged);
      if (merged) climber->height |= kMergedBit;
    }
    climber->slot = parents[index];
    if (climber->leaf_count >= SIZE || (climber->slot == kNoSlot && climber->leaf_count > 2))
      return index;
  }
  *root_height = climber->height;
  return NONE;
}

// Edges from the root of the tree to a node.
uint depth_of(const uint node, global const uint* parents) {
  uint depth = 0;
  for (uint slot = parents[node]; slot != kNoSlot; slot = parents[slot / 2]) ++depth;
  return depth;
}

// What the work-group does between two barriers.
enum {
  kElect,   // the first item chooses whose treelet is next
  kBegin,   // it is the root alone
  kGrow,    // a node is loaded, or there are enough leaves
  kDivide,  // its children become leaves
  kChoose,  // the next one is chosen
  kSearch,  // the treelet is measured as it is, the search begins
  kSolve,   // subsets of one size are solved
  kPlan,    // what was found is compared
  kStore,   // it is written
  kClimb    // who came to the treelet goes on
};

/// One round over the whole tree. One work-item per leaf, 1D range, work-groups of 32.
/// @param firsts        [leaf_count + 1] first photon of each leaf, then n
/// @param nodes         [leaf_count - 1] in/out
/// @param costs         [leaf_count - 1] out
/// @param parents       [leaf_count - 1] in/out: 2 * node above + side; kNoSlot of the root
/// @param leaf_parents  [n] in/out: the same at the first photon of each leaf
/// @param meetings      [leaf_count - 1] in: not `round` + 1
/// @param root_height   [1] in/out: of the whole tree, edges; with kMergedBit where it is one leaf
/// @param subsets       [2^TREELET_SIZE] sets of leaves, a bit for each, by their number of leaves
kernel void restructure_treelets(global const uint* restrict firsts, global Node* nodes,
                                 global NodeCosts* costs, global uint* parents,
                                 global uint* leaf_parents, volatile global Meeting* meetings,
                                 global uint* root_height, global const ushort* restrict subsets,
                                 const TreeletParams params) {
  local Treelet treelet;
  local uint roots[32];
  local uint chosen;
  local float old_cost;
  local uint improved;
  const uint item = get_local_id(0);

  Climber climber = {kNoSlot, 1, 0, 0};
  roots[item] = NONE;
  if (get_global_id(0) < params.leaf_count) {
    const uint first = firsts[get_global_id(0)];
    const uint count = firsts[get_global_id(0) + 1] - first;
    climber.slot = leaf_parents[first];
    if (may_merge(count, params)) {
      global const Node* node = nodes + climber.slot / 2;
      const bool is_right = climber.slot % 2 != 0;
      const float3 low = is_right ? vload3(0, node->right_min) : vload3(0, node->left_min);
      const float3 high = is_right ? vload3(0, node->right_max) : vload3(0, node->left_max);
      climber.cost = leaf_cost(measure(low, high, params.measure), count);
    }
    roots[item] = climb(&climber, meetings, nodes, costs, parents, root_height, params);
    GROUP_FENCE();
  }

  // All steps share one barrier: PoCL 3.1 miscompiles loops with barriers within such loops.
  uint step = kElect, node = 0, size = 0;
  while (true) {
    // What the items did in the step before is seen by all; of global memory see GROUP_FENCE.
    barrier(CLK_LOCAL_MEM_FENCE);
    if (step == kBegin && chosen == 32) break;
    switch (step) {
      case kElect:
        if (item == 0) {
          uint i = 0;
          while (i < 32 && roots[i] == NONE) ++i;
          chosen = i;
        }
        step = kBegin;
        break;
      case kBegin:
        GROUP_FENCE();
        if (item == 0) {
          treelet.leaf_count = 1;
          treelet.nodes[0] = roots[chosen];
          treelet.next = 0;
        }
        node = 0;
        step = kGrow;
        break;
      case kGrow:
        if (treelet.next != NONE) {
          load_node(&treelet, node, nodes, costs);
          step = kDivide;
        } else {
          if (item < treelet.leaf_count)
            treelet.children[treelet.owners[item] % 2][treelet.owners[item] / 2] = (uchar)item;
          step = kSearch;
        }
        break;
      case kDivide:
        if (item < 2) take_leaf(&treelet, item, node, params);
        step = kChoose;
        break;
      case kChoose:
        if (item == 0) choose_leaf(&treelet, node);
        ++node;
        step = kGrow;
        break;
      case kSearch:
        if (item == 0) {
          assemble(&treelet, params);
          old_cost = treelet.costs[SIZE];
        }
        begin_search(&treelet);
        size = 2;
        step = kSolve;
        break;
      case kSolve:
        solve_size(&treelet, size, subsets, params);
        step = size == treelet.leaf_count ? kPlan : kSolve;
        ++size;
        break;
      case kPlan:
        if (item == 0) {
          end_search(&treelet, params);
          assemble(&treelet, params);
          const uint height = treelet.heights[SIZE] & ~kMergedBit;
          const bool fits = height + (*root_height & ~kMergedBit) <= kMaxDepth ||
                            height + depth_of(treelet.nodes[0], parents) <= kMaxDepth;
          improved = fits && treelet.costs[SIZE] < old_cost * params.keep ? 1 : 0;
        }
        step = kStore;
        break;
      case kStore:
        if (improved != 0) store(&treelet, nodes, costs, parents, leaf_parents, params);
        GROUP_FENCE();
        step = kClimb;
        break;
      case kClimb:
        if (item == chosen) {
          GROUP_FENCE();
          if (improved != 0) {
            climber.height = treelet.heights[SIZE];
            climber.cost = may_merge(treelet.counts[SIZE], params) ? treelet.costs[SIZE] : 0.0f;
          }
          roots[item] = climb(&climber, meetings, nodes, costs, parents, root_height, params);
          GROUP_FENCE();
        }
        step = kElect;
        break;
    }
  }
}
