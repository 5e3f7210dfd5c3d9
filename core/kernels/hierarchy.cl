// The radix tree over the leaves (Karras 2012), with boxes, counts and smallest photon indices, all
// bottom-up in one launch (Apetrei 2014): a subtree finds its parent by comparing the levels of its
// two boundaries; the second of two siblings to come carries on. Uses meeting.cl.

#define NOBODY 0xffffffffu

/// Builds the tree. One work-item per leaf, 1D range, any work-group size.
/// @param levels    [n - 1] split levels
/// @param firsts    [leaf_count + 1] first photon of each leaf, then n
/// @param photons   [n] in leaf order
/// @param meetings  [leaf_count - 1] in: NOBODY; used up
/// @param nodes     [leaf_count - 1] out: node i separates leaves i and i + 1
/// @param min_ids   [2 * (leaf_count - 1)] out: smallest photon index below each left, right child
/// @param heights   [2 * (leaf_count - 1)] out: edges from each left, right child to the deepest
/// leaf below it
/// @param climbs    [leaf_count] out: leaves below each node that this leaf's item finished, summed
/// @param block_flags  [leaf_count + 1] out: 1 where a block of the wide tree begins, else 0; the
/// last is 0
/// @param root      [1] out
kernel void hierarchy(global const uchar* restrict levels, global const uint* restrict firsts,
                      const uint leaf_count, global const LeafPhoton* restrict photons,
                      volatile global Meeting* meetings, global Node* nodes, global uint* min_ids,
                      global uchar* heights, global ulong* climbs, global uint* block_flags,
                      global Root* root) {
  uint a = get_global_id(0), b = a;  // leaves of the subtree
  if (a >= leaf_count) return;
  uint link = kLeafBit | firsts[a];
  const uint leaf = a;
  uint count = firsts[a + 1] - firsts[a], min_id = NOBODY, height = 0;
  ulong climb = 0;
  float3 low = INFINITY, high = -INFINITY;
  for (uint i = 0; i < count; ++i) {
    const float4 photon = load_photon(photons, firsts[a] + i);
    low = fmin(low, photon.xyz);
    high = fmax(high, photon.xyz);
    min_id = min(min_id, as_uint(photon.w));
  }
  // Cleared before the item meets another, set by whom it meets later.
  block_flags[a] = 0;
  if (a == 0) block_flags[leaf_count] = 0;
  while (b - a + 1 < leaf_count) {
    const int left = a > 0 ? (int)levels[firsts[a] - 1] : -1;
    const int right = b + 1 < leaf_count ? (int)levels[firsts[b + 1] - 1] : -1;
    const bool is_right = left > right;
    const uint parent = is_right ? a - 1 : b;
    global Node* node = &nodes[parent];
    if (is_right) {
      vstore3(low, 0, node->right_min);
      vstore3(high, 0, node->right_max);
      node->right = link;
      node->right_count = count;
    } else {
      vstore3(low, 0, node->left_min);
      vstore3(high, 0, node->left_max);
      node->left = link;
      node->left_count = count;
    }
    min_ids[2 * parent + is_right] = min_id;
    heights[2 * parent + is_right] = (uchar)height;
    climbs[leaf] = climb;
    // This item wrote one half of the node and releases it; the second to come acquires the other's
    // half. The value exchanged tells how far the other's leaves reach.
    const uint end = EXCHANGE(&meetings[parent], is_right ? b : a);
    if (end == NOBODY) return;
    const uint sibling_count = is_right ? node->left_count : node->right_count;
    if (count + sibling_count > kBlockSize) {
      // Children that fit a block, or cannot be divided, are blocks: their parent is too large.
      const uint sibling = is_right ? end : b + 1, sibling_last = is_right ? a - 1 : end;
      if (count <= kBlockSize || a == b) block_flags[a] = 1;
      if (sibling_count <= kBlockSize || sibling == sibling_last) block_flags[sibling] = 1;
    }
    count += sibling_count;
    if (is_right) {
      low = fmin(low, vload3(0, node->left_min));
      high = fmax(high, vload3(0, node->left_max));
      a = end;
    } else {
      low = fmin(low, vload3(0, node->right_min));
      high = fmax(high, vload3(0, node->right_max));
      b = end;
    }
    min_id = min(min_id, min_ids[2 * parent + !is_right]);
    height = max(height, (uint)heights[2 * parent + !is_right]) + 1;
    climb += b - a + 1;
    link = parent;
  }
  climbs[leaf] = climb;
  if (count <= kBlockSize || leaf_count == 1) block_flags[0] = 1;
  vstore3(low, 0, root->min);
  vstore3(high, 0, root->max);
  root->link = link;
  root->count = count;
  root->depth = height;
}
