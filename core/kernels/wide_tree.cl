// The wide tree over the leaf order that sub-groups walk: blocks, the maximal subtrees of at most
// kBlockSize photons, then nodes of 32 consecutive children, level by level, up to at most 32. Node
// i of a level holds children 32 i to 32 i + 31 of the level below. Uses sub_group.cl.

/// Lists the first photon of each block, and n behind them. One work-item per leaf and one more.
/// @param places  [leaf_count + 1] exclusive sum of the flags of hierarchy.cl
/// @param firsts  [leaf_count + 1] first photon of each leaf, then n
/// @param blocks  [block_count + 1] out: `first` alone
kernel void wide_block_firsts(global const uint* restrict places,
                              global const uint* restrict firsts, const uint leaf_count,
                              global WideBox* restrict blocks) {
  const uint i = get_global_id(0);
  if (i > leaf_count) return;
  if (i == leaf_count || places[i] != places[i + 1]) blocks[places[i]].first = firsts[i];
}

/// Computes the boxes of the blocks. One sub-group per block.
/// @param photons  [n] in leaf order
/// @param blocks   [block_count + 1] in: `first`; out: the rest, but of the last
kernel void wide_blocks(global const LeafPhoton* restrict photons, const uint block_count,
                        global WideBox* restrict blocks) {
  const uint block = get_global_id(0) / SUB_GROUP_SIZE;
  if (block >= block_count) return;
  uint low[3], high[3], min_id = kNoPhoton;
  for (uint c = 0; c < 3; ++c) low[c] = 0xffffffffu, high[c] = 0;
  const uint end = blocks[block + 1].first;
  for (uint i = blocks[block].first + sub_group_lane(); i < end; i += SUB_GROUP_SIZE) {
    const float4 photon = vload4(i, (global const float*)photons);
    const uint bits[3] = {ordered_bits(photon.x), ordered_bits(photon.y), ordered_bits(photon.z)};
    for (uint c = 0; c < 3; ++c) low[c] = min(low[c], bits[c]), high[c] = max(high[c], bits[c]);
    min_id = min(min_id, as_uint(photon.w));
  }
  for (uint c = 0; c < 3; ++c) {
    low[c] = sub_group_min(low[c]);
    high[c] = sub_group_max(high[c]);
  }
  min_id = sub_group_min(min_id);
  if (sub_group_lane() != 0) return;
  for (uint c = 0; c < 3; ++c) {
    blocks[block].min[c] = from_ordered_bits(low[c]);
    blocks[block].max[c] = from_ordered_bits(high[c]);
  }
  blocks[block].min_id = min_id;
}

/// Computes the boxes of one level from the level below. One sub-group per node.
/// @param boxes  of all levels: the one below begins at `below`, has `below_count`; out: at `nodes`
kernel void wide_level(global WideBox* boxes, const uint below, const uint below_count,
                       const uint nodes) {
  const uint node = get_global_id(0) / SUB_GROUP_SIZE;
  if (node * SUB_GROUP_SIZE >= below_count) return;
  // Behind the last child comes the last again.
  const uint child = below + min((uint)get_global_id(0), below_count - 1);
  uint low[3], high[3];
  for (uint c = 0; c < 3; ++c) {
    low[c] = sub_group_min(ordered_bits(boxes[child].min[c]));
    high[c] = sub_group_max(ordered_bits(boxes[child].max[c]));
  }
  const uint min_id = sub_group_min(boxes[child].min_id);
  if (sub_group_lane() != 0) return;
  for (uint c = 0; c < 3; ++c) {
    boxes[nodes + node].min[c] = from_ordered_bits(low[c]);
    boxes[nodes + node].max[c] = from_ordered_bits(high[c]);
  }
  boxes[nodes + node].min_id = min_id;
}
