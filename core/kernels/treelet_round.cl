// One round of treelet restructuring: bottom-up from the leaves of a tree, the second of two siblings
// to come carries on. A work-group of 32 brings 32 leaves up; where one of its work-items comes to
// the root of a treelet, all work on it. Uses meeting.cl, measure.cl, treelet.cl and
// treelet_search.cl.

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
