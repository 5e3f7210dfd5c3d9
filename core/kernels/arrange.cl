// The leaf order of a tree whose nodes have been restructured: every leaf and node climbs to the
// root and adds up what lies left of it.


/// Tells children their parents. One work-item per node.
/// @param parents       [node_count] out: 2 * node above + side; kNoSlot of the root
/// @param leaf_parents  [n] out: the same at the first photon of each leaf
/// @param root_height   [1] out: edges
kernel void link_parents(global const Node* restrict nodes, const uint node_count,
                         global const Root* restrict root, global uint* restrict parents,
                         global uint* restrict leaf_parents, global uint* restrict root_height) {
  const uint i = get_global_id(0);
  if (i >= node_count) return;
  if (i == root->link) {
    parents[i] = kNoSlot;
    *root_height = root->depth;
  }
  const uint links[2] = {nodes[i].left, nodes[i].right};
  for (uint side = 0; side < 2; ++side) {
    if ((links[side] & kLeafBit) != 0) {
      leaf_parents[links[side] & ~kLeafBit] = 2 * i + side;
    } else {
      parents[links[side]] = 2 * i + side;
    }
  }
}

/// Copies the photons to their places. One work-item per leaf.
/// @param firsts       [leaf_count + 1] first photon of each leaf, then n
/// @param photons      [n]
/// @param root_height  [1] with kMergedBit where the whole tree becomes one leaf
/// @param out          [n] in the new order
/// @param flags        [n + 1] out: 1 where a leaf begins once merged subtrees are leaves, else 0;
/// flags[n] is 0
kernel void arrange_leaves(global const uint* restrict firsts, const uint leaf_count,
                           global const LeafPhoton* restrict photons,
                           global const Node* restrict nodes,
                           global const NodeCosts* restrict costs,
                           global const uint* restrict parents,
                           global const uint* restrict leaf_parents,
                           global const uint* restrict root_height,
                           global LeafPhoton* restrict out, global uint* restrict flags) {
  const uint i = get_global_id(0);
  if (i >= leaf_count) return;
  const uint first = firsts[i], count = firsts[i + 1] - first;
  uint place = 0;       // within the subtree climbed so far
  bool begins = true;   // the topmost merged subtree, if any
  for (uint slot = leaf_parents[first]; slot != kNoSlot; slot = parents[slot / 2]) {
    if ((costs[slot / 2].heights[slot % 2] & kMergedBit) != 0) begins = place == 0;
    if (slot % 2 != 0) place += nodes[slot / 2].left_count;
  }
  if ((*root_height & kMergedBit) != 0) begins = place == 0;
  for (uint j = 0; j < count; ++j) {
    out[place + j] = photons[first + j];
    flags[place + j] = j == 0 && begins ? 1 : 0;
  }
  if (i == 0) flags[firsts[leaf_count]] = 0;
}

/// Sets the levels between leaves: the depth of the node that separates them. One work-item per
/// node.
/// @param levels  [n - 1] out, but for boundaries within the leaves
kernel void arrange_levels(global const Node* restrict nodes, const uint node_count,
                           global const uint* restrict parents, global uchar* restrict levels) {
  const uint i = get_global_id(0);
  if (i >= node_count) return;
  uint place = nodes[i].left_count, depth = 0;
  for (uint slot = parents[i]; slot != kNoSlot; slot = parents[slot / 2]) {
    if (slot % 2 != 0) place += nodes[slot / 2].left_count;
    ++depth;
  }
  levels[place - 1] = (uchar)depth;
}
