// One round of treelet restructuring: bottom-up from the leaves of a tree, the second of two siblings
// to come carries on. A work-group brings its leaves up to the roots of treelets. It works on up to
// TEAMS of them at once, each by a team of its work-items, the larger the fewer roots wait. Uses
// meeting.cl, measure.cl, treelet.cl and treelet_search.cl.
// -DGROUP_SIZE, -DLEAVES_PER_ITEM, -DTEAMS

// Writes a node of the treelet back.
void store(local const Treelet* treelet, const uint node, global Node* nodes,
           global NodeCosts* costs, global uint* parents, global uint* leaf_parents,
           const TreeletParams params) {
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
  kElect,   // each team gets a root that waits
  kChoose,  // each chooses the leaf of its treelet that is divided next
  kDivide,  // its children become leaves
  kSearch,  // the treelet is measured as it is, the search begins
  kSolve,   // subsets of one size are solved
  kPlan,    // what was found is compared
  kStore,   // it is written
  kClimb    // who came to the treelet goes on
};

/// One round over the whole tree. One work-item per LEAVES_PER_ITEM leaves, 1D range, work-groups of
/// GROUP_SIZE.
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
  local Treelet treelets[TEAMS];
  local uint waiting[GROUP_SIZE * LEAVES_PER_ITEM];  // roots of treelets
  local uint waiting_count;
  const uint item = get_local_id(0);
  if (item == 0) waiting_count = 0;
  barrier(CLK_LOCAL_MEM_FENCE);

  for (uint i = 0; i < LEAVES_PER_ITEM; ++i) {
    const uint leaf = (get_group_id(0) * LEAVES_PER_ITEM + i) * GROUP_SIZE + item;
    if (leaf >= params.leaf_count) break;
    const uint first = firsts[leaf], count = firsts[leaf + 1] - first;
    Climber climber = {leaf_parents[first], 1, 0, 0};
    if (may_merge(count, params)) {
      global const Node* node = nodes + climber.slot / 2;
      const bool is_right = climber.slot % 2 != 0;
      const float3 low = is_right ? vload3(0, node->right_min) : vload3(0, node->left_min);
      const float3 high = is_right ? vload3(0, node->right_max) : vload3(0, node->left_max);
      climber.cost = leaf_cost(measure(low, high, params.measure), count);
    }
    const uint root = climb(&climber, meetings, nodes, costs, parents, root_height, params);
    if (root != NONE) waiting[atomic_inc(&waiting_count)] = root;
  }
  GROUP_FENCE();

  // All steps share one barrier: PoCL 3.1 miscompiles loops with barriers within such loops.
  uint step = kElect, size = 0;
  uint count = 0, team_count = 1, lane = 0, lane_count = GROUP_SIZE;  // of roots, items of a team
  uint node = 0, leaf_count = 0, next = 0, index = 0;  // while the treelet of the team grows
  bool active = false;
  local Treelet* treelet = treelets;
  while (true) {
    // What the items did in the step before is seen by all; of global memory see GROUP_FENCE.
    barrier(CLK_LOCAL_MEM_FENCE);
    if (step == kElect && waiting_count == 0) break;
    switch (step) {
      case kElect:
        GROUP_FENCE();
        count = waiting_count;
        team_count = 1;
        while (team_count < TEAMS && team_count < count) team_count *= 2;
        lane_count = GROUP_SIZE / team_count;
        lane = item % lane_count;
        treelet = &treelets[item / lane_count];
        active = item / lane_count < count;
        if (active) index = waiting[count - 1 - item / lane_count];
        node = 0;
        leaf_count = 1;
        next = 0;
        step = kDivide;
        break;
      case kChoose:
        if (active && next != NONE) {
          next = choose_leaf(treelet, leaf_count);
          if (next != NONE) index = treelet->links[next];
        }
        step = kDivide;
        break;
      case kDivide:
        if (item == 0 && node == 0) waiting_count = count - min(count, team_count);
        if (active && next != NONE) {
          if (lane < 2) take_leaf(treelet, lane, node, next, index, nodes, costs, params);
          ++leaf_count;
        }
        ++node;
        step = node + 1 < SIZE ? kChoose : kSearch;
        break;
      case kSearch:
        if (active) {
          for (uint leaf = lane; leaf < leaf_count; leaf += lane_count) {
            const uint owner = treelet->owners[leaf];
            treelet->children[owner % 2][owner / 2] = (uchar)leaf;
          }
          if (lane == 0) treelet->leaf_count = leaf_count;
          begin_search(treelet, leaf_count, lane, lane_count);
        }
        size = 2;
        step = SEARCH == AGGLOMERATIVE ? kPlan : kSolve;
        break;
      case kSolve:
        if (active)
          solve_size(treelet, leaf_count, size, subsets, lane, lane_count, params);
        step = size == SIZE ? kPlan : kSolve;
        ++size;
        break;
      case kPlan:
        if (active && lane == 0) {
          assemble(treelet, params);
          treelet->cost = treelet->costs[SIZE];
          treelet->height = treelet->heights[SIZE];
          end_search(treelet, params);
          assemble(treelet, params);
          const uint height = treelet->heights[SIZE] & ~kMergedBit;
          const bool fits = height + (*root_height & ~kMergedBit) <= kMaxDepth ||
                            height + depth_of(treelet->nodes[0], parents) <= kMaxDepth;
          treelet->improved =
              fits && treelet->costs[SIZE] < treelet->cost * params.keep ? 1 : 0;
          if (treelet->improved != 0) {
            treelet->cost = treelet->costs[SIZE];
            treelet->height = treelet->heights[SIZE];
          }
        }
        step = kStore;
        break;
      case kStore:
        if (active && treelet->improved != 0) {
          for (uint i = lane; i + 1 < leaf_count; i += lane_count)
            store(treelet, i, nodes, costs, parents, leaf_parents, params);
        }
        GROUP_FENCE();
        step = kClimb;
        break;
      case kClimb:
        if (active && lane == 0) {
          GROUP_FENCE();
          const uint root = treelet->nodes[0];
          Climber climber = {parents[root], treelet->leaf_counts[SIZE], treelet->height,
                             may_merge(treelet->counts[SIZE], params) ? treelet->cost : 0.0f};
          const uint above = climb(&climber, meetings, nodes, costs, parents, root_height, params);
          if (above != NONE) waiting[atomic_inc(&waiting_count)] = above;
          GROUP_FENCE();
        }
        step = kElect;
        break;
    }
  }
}
