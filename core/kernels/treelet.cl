// A treelet in local memory: how it grows, and what it costs (Karras and Aila 2013; core/cpu/treelet.h
// says how we differ). Uses measure.cl.
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
