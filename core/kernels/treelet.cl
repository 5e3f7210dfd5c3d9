// A treelet in local memory: how it grows, and what it costs (Karras and Aila 2013; core/cpu/treelet.h
// says how we differ). Uses measure.cl.
// -DTREELET_SIZE: leaves of a treelet at most. -DSEARCH: KD_TREE, BVH or AGGLOMERATIVE.

#define KD_TREE 0
#define BVH 1
#define AGGLOMERATIVE 2

#define SIZE TREELET_SIZE
#define SUBSETS (1 << SIZE)
#define NONE 0xffffffffu

#if SEARCH != AGGLOMERATIVE
// Sets of leaves are told by their low and their high bits.
#define LOW_BITS ((SIZE + 1) / 2)
#define HIGH_BITS (SIZE - LOW_BITS)

// Box and photons of a set of leaves.
typedef struct SubsetExtent {
  float low[3], high[3];
  uint count;
} SubsetExtent;
#endif

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
  // What its root costs and how high it is, as it was and then as it is.
  float cost;
  uint height;
  uint improved;
#if SEARCH != AGGLOMERATIVE
  float subset_costs[SUBSETS];
  ushort subset_lefts[SUBSETS];  // 0: there is no cut
  SubsetExtent low_extents[1 << LOW_BITS], high_extents[1 << HIGH_BITS];
#endif
#if SEARCH == KD_TREE
  // Cuts before the leaf at each place of the order on each axis, three sets of leaves, SIZE bits
  // each: those before it, of them those that do not end below it, and those that reach over it.
  uint cuts[3][SIZE];
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

// The leaf of `leaf_count` that is divided next, NONE where none can be.
uint choose_leaf(local const Treelet* treelet, const uint leaf_count) {
  float priority = -1;
  uint next = NONE;
  for (uint i = 0; i < leaf_count; ++i) {
    if (treelet->priorities[i] <= priority) continue;
    priority = treelet->priorities[i];
    next = i;
  }
  return next;
}

// Divides the leaf `next`, which is the node `index` of the tree and becomes number `node` of the
// treelet: makes its child on `side` a leaf, in its place or behind all others.
void take_leaf(local Treelet* treelet, const uint side, const uint node, const uint next,
               const uint index, global const Node* nodes, global const NodeCosts* costs,
               const TreeletParams params) {
  const uint leaf = side == 0 ? next : node + 1;
  if (side == 0) {
    treelet->nodes[node] = index;
    if (node > 0) {
      const uint owner = treelet->owners[leaf];
      treelet->children[owner % 2][owner / 2] = (uchar)(SIZE + node);
    }
  }
  global const Node* from = nodes + index;
  const bool right = side != 0;
  const float3 low = right ? vload3(0, from->right_min) : vload3(0, from->left_min);
  const float3 high = right ? vload3(0, from->right_max) : vload3(0, from->left_max);
  const uint link = right ? from->right : from->left;
  const uint count = right ? from->right_count : from->left_count;
  set_part_box(treelet, leaf, low, high);
  treelet->links[leaf] = link;
  treelet->counts[leaf] = count;
  treelet->costs[leaf] = costs[index].costs[side];
  treelet->leaf_counts[leaf] = costs[index].leaf_counts[side];
  treelet->heights[leaf] = costs[index].heights[side];
  treelet->owners[leaf] = (uchar)(2 * node + side);
  treelet->priorities[leaf] = (link & kLeafBit) != 0  ? -1.0f
                              : params.round % 2 == 0 ? measure(low, high, params.measure)
                                                      : (float)count;
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
