// The wide tree over the leaf order that sub-groups walk: blocks, the maximal subtrees of at most
// kBlockSize photons, then nodes, the maximal subtrees of at most 32 members of the level below,
// level by level, up to at most 32. Uses sub_group.cl and large_subtree.cl.
//
// Where subtrees are so uneven that many nodes would have few members, 32 neighbours become one
// node instead, so that a level has at most (max_begins + 1) / 32 of the members of the one below.

#ifndef GROUP_SIZE
#define GROUP_SIZE 256
#endif

#define MEMBERS 32                    // of a node, at most
#define NODE_TILE (GROUP_SIZE - 64)   // members of one work-group
#define TILE_WORDS (GROUP_SIZE / 32)  // of bits of its members, the one before and the one after
#define NODE_REACH (MEMBERS + 1)      // boundaries looked at on either side

/// Lists the first photon of each block, and n behind them. One work-item per leaf and one more.
/// @param places  [leaf_count + 1] exclusive sum of the flags of hierarchy.cl
/// @param firsts  [leaf_count + 1] first photon of each leaf, then n
/// @param levels  [n - 1] split levels
/// @param blocks  [block_count + 1] out: `first` alone
/// @param meets   [2 * stride] out: split levels between blocks, in the first half
/// @param sizes   [1] out: of a tree of blocks alone
kernel void wide_block_firsts(global const uint* restrict places,
                              global const uint* restrict firsts, const uint leaf_count,
                              global const uchar* restrict levels, global WideBox* restrict blocks,
                              global uchar* restrict meets, global WideSizes* restrict sizes) {
  const uint i = get_global_id(0);
  if (i > leaf_count) return;
  const uint block = places[i];
  if (i == leaf_count) {
    blocks[block].first = firsts[i];
    sizes->level_count = 1;
    sizes->counts[0] = block;
  } else if (block != places[i + 1]) {
    blocks[block].first = firsts[i];
    if (block > 0) meets[block - 1] = levels[firsts[i] - 1];
  }
}

// Writes the box around those of the items, but for `first`.
void write_box(const float3 low_of_item, const float3 high_of_item, const uint min_id_of_item,
               global WideBox* box) {
  const uint bits[6] = {ordered_bits(low_of_item.x),  ordered_bits(low_of_item.y),
                        ordered_bits(low_of_item.z),  ordered_bits(high_of_item.x),
                        ordered_bits(high_of_item.y), ordered_bits(high_of_item.z)};
  uint low[3], high[3];
  for (uint c = 0; c < 3; ++c) {
    low[c] = sub_group_min(bits[c]);
    high[c] = sub_group_max(bits[3 + c]);
  }
  const uint min_id = sub_group_min(min_id_of_item);
  if (sub_group_lane() != 0) return;
  for (uint c = 0; c < 3; ++c) {
    box->min[c] = from_ordered_bits(low[c]);
    box->max[c] = from_ordered_bits(high[c]);
  }
  box->min_id = min_id;
}

/// Computes the boxes of the blocks. One sub-group per block.
/// @param photons  [n] in leaf order
/// @param blocks   [block_count + 1] in: `first`; out: the rest, but of the last
kernel void wide_blocks(global const LeafPhoton* restrict photons, const uint block_count,
                        global WideBox* restrict blocks) {
  const uint block = get_global_id(0) / SUB_GROUP_SIZE;
  if (block >= block_count) return;
  float3 low = INFINITY, high = -INFINITY;
  uint min_id = kNoPhoton;
  const uint end = blocks[block + 1].first;
  for (uint i = blocks[block].first + sub_group_lane(); i < end; i += SUB_GROUP_SIZE) {
    const float4 photon = load_photon(photons, i);
    low = fmin(low, photon.xyz);
    high = fmax(high, photon.xyz);
    min_id = min(min_id, as_uint(photon.w));
  }
  write_box(low, high, min_id, blocks + block);
}

// Finds the members of a tile that begin a node: bits, 32 members to a word; words 1 to
// TILE_WORDS - 2 are of the tile's own members.
// `meets`: [n - 1] split levels between members. `window`: [GROUP_SIZE + 2 * NODE_REACH].
void find_nodes(global const uchar* meets, const uint n, const uint tile, const uint max_begins,
                local uchar* window, local uint* words) {
  const uint item = get_local_id(0), word = item / 32;
  const int begin = (int)(tile * NODE_TILE) - 32, i = begin + (int)item;
  const int base = max(begin - NODE_REACH, 0);
  const int end = min(begin + GROUP_SIZE + NODE_REACH, (int)n - 1);
  for (int at = base + (int)item; at < end; at += GROUP_SIZE) window[at - base] = meets[at];
  // All of the window is read by any item.
  barrier(CLK_LOCAL_MEM_FENCE);
  const bool begins = i >= 0 && i < (int)n && (i == 0 || is_large(window, base, i - 1, n, MEMBERS));
  const uint votes = sub_group_vote(begins);
  if (item % 32 == 0) words[word] = votes;
  // All words are written ...
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint before = word > 0 ? words[word - 1] : 0;
  // ... and read, before they are changed.
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item % 32 == 0 && i >= 0 && i < (int)n) {
    const bool many = popcount(votes) > max_begins;
    words[word] = (many ? 1 : votes) | (popcount(before) > max_begins ? 1 : 0);
  }
  // The words are right, but for the first, and those before the tile are not read.
  barrier(CLK_LOCAL_MEM_FENCE);
}

// Nodes that begin in the tile.
uint count_nodes(local const uint* words) {
  uint count = 0;
  for (uint word = 1; word + 1 < TILE_WORDS; ++word) count += popcount(words[word]);
  return count;
}

// Makes the nodes that begin in a tile, from node `place` on; returns their number.
uint make_nodes(global WideBox* boxes, const uint below, const uint n, const uint at,
                const uint place, const uint tile, local const uint* words, local uint* begins,
                global const uchar* meets, global uchar* meets_above) {
  const uint item = get_local_id(0), word = item / 32, tile_end = (tile + 1) * NODE_TILE;
  const uint count = count_nodes(words);
  if (word > 0 && word + 1 < TILE_WORDS && (words[word] >> item % 32 & 1) != 0) {
    uint node = popcount(words[word] & ((1u << item % 32) - 1));
    for (uint other = 1; other < word; ++other) node += popcount(words[other]);
    begins[node] = tile * NODE_TILE + item - 32;
  }
  if (item == 0) {
    const uint after = words[TILE_WORDS - 1];
    begins[count] = after != 0 ? tile_end + ctz(after) : n;
  }
  // The list is complete.
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint node = word; node < count; node += TILE_WORDS) {
    const uint first = begins[node];
    // Behind the last member comes the last again.
    const uint member = min(first + item % 32, begins[node + 1] - 1);
    global const float4* words_below = (global const float4*)(boxes + below + member);
    const float4 low = words_below[0], high = words_below[1];
    write_box(low.xyz, high.xyz, as_uint(low.w), boxes + at + place + node);
    if (item % 32 == 0) {
      boxes[at + place + node].first = first;
      if (first > 0) meets_above[place + node - 1] = meets[first - 1];
    }
  }
  return count;
}

/// Counts the nodes that begin in each tile. One work-group of GROUP_SIZE per tile of NODE_TILE
/// members; more than there are do nothing.
/// @param meets   [2 * stride] split levels between members, in the first half where `level` is
/// even
/// @param sizes   [1] knows the number of members: counts[level]
/// @param counts  [tiles] out
kernel void wide_counts(global const uchar* restrict meets, const uint stride,
                        global const WideSizes* restrict sizes, const uint level,
                        const uint max_begins, global uint* restrict counts) {
  local uchar window[GROUP_SIZE + 2 * NODE_REACH];
  local uint words[TILE_WORDS];
  const uint n = sizes->counts[level], tile = get_group_id(0);
  if (tile * NODE_TILE >= n) return;
  find_nodes(meets + level % 2 * stride, n, tile, max_begins, window, words);
  if (get_local_id(0) == 0) counts[tile] = count_nodes(words);
}

/// Makes the nodes above a level; ranges as wide_counts.
/// @param boxes   of all levels of `tree`
/// @param meets   [2 * stride] in: of the members; out: of the nodes, the other half
/// @param sizes   [1] in: counts[level]; out: counts[level + 1]
/// @param counts  [tiles] nodes of each tile
kernel void wide_nodes(global WideBox* boxes, const WideTree tree, global uchar* meets,
                       const uint stride, global WideSizes* sizes, const uint level,
                       const uint max_begins, global const uint* restrict counts) {
  local uchar window[GROUP_SIZE + 2 * NODE_REACH];
  local uint words[TILE_WORDS], begins[GROUP_SIZE], place;
  const uint n = sizes->counts[level], tile = get_group_id(0), at = tree.offsets[level + 1];
  global uchar *meets_of = meets + level % 2 * stride, *above = meets + (level + 1) % 2 * stride;
  if (tile * NODE_TILE >= n) return;
  if (get_local_id(0) == 0) place = 0;
  find_nodes(meets_of, n, tile, max_begins, window, words);
  uint before = 0;
  for (uint i = get_local_id(0); i < tile; i += GROUP_SIZE) before += counts[i];
  before = sub_group_add(before);
  if (sub_group_lane() == 0) atomic_add(&place, before);
  // All have added.
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint count =
      make_nodes(boxes, tree.offsets[level], n, at, place, tile, words, begins, meets_of, above);
  if ((tile + 1) * NODE_TILE >= n && get_local_id(0) == 0) {
    boxes[at + place + count].first = n;
    sizes->counts[level + 1] = place + count;
    sizes->level_count = level + 2;
  }
}

/// Makes all levels above `level`, as long as there are more than 32 members. One work-group.
/// @param meets  as wide_nodes; used up
kernel void wide_top(global WideBox* boxes, const WideTree tree, global uchar* meets,
                     const uint stride, global WideSizes* sizes, uint level,
                     const uint max_begins) {
  local uchar window[GROUP_SIZE + 2 * NODE_REACH];
  local uint words[TILE_WORDS], begins[GROUP_SIZE];
  uint n = sizes->counts[level];
  for (; n > MEMBERS; ++level) {
    global uchar *meets_of = meets + level % 2 * stride, *above = meets + (level + 1) % 2 * stride;
    const uint at = tree.offsets[level + 1];
    uint place = 0;
    for (uint tile = 0; tile * NODE_TILE < n; ++tile) {
      find_nodes(meets_of, n, tile, max_begins, window, words);
      place += make_nodes(boxes, tree.offsets[level], n, at, place, tile, words, begins, meets_of,
                          above);
      // This tile's words and list are read, before the next are written; its nodes are written.
      barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    }
    if (get_local_id(0) == 0) {
      boxes[at + place].first = n;
      sizes->counts[level + 1] = place;
    }
    n = place;
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
  }
  if (get_local_id(0) == 0) sizes->level_count = level + 1;
}
