// Subtrees rebuilt by a sweep (core/cpu/sweep.h says which cut is taken), one work-group each, in
// local memory, all nodes of a depth at once. Uses measure.cl and subtree.cl.

// T of core/cpu/sweep.h: photons, or leaves that they fill.
uint units_of(const uint count, const SweepParams params) {
  return (count + params.unit_size - 1) / params.unit_size;
}

uint imbalance_of(const uint left, const uint count) {
  return 2 * left > count ? 2 * left - count : count - 2 * left;
}

bool is_better(const float cost, const uint imbalance, const float best_cost,
               const uint best_imbalance) {
  return cost < best_cost || (cost == best_cost && imbalance < best_imbalance);
}

// Computes the boxes of what reaches over the chunk's ends.
void measure_chunk(local Subtree* tree, const uint now, const uint axis, const uint chunk,
                   const uint end) {
  local const ushort* order = tree->orders[now][axis];
  Run run = {0, chunk * CHUNK, 0, 0, 0};
  while (find_run(tree, now, run.end, end, &run)) {
    const bool is_head = run.first < run.begin, is_tail = run.last > run.end;
    if (!is_head && !is_tail) continue;
    float3 low = INFINITY, high = -INFINITY;
    for (uint i = run.begin; i < run.end; ++i) {
      const float3 p = position_of(tree, order[i]);
      low = fmin(low, p);
      high = fmax(high, p);
    }
    if (is_head) store_box(tree->heads, axis, chunk, low, high);
    if (is_tail) store_box(tree->tails, axis, chunk, low, high);
  }
}

// Finds the best cut of each run of a chunk on one axis: before one of its photons, of equal cuts
// the first.
void sweep_chunk(local Subtree* tree, const uint now, const uint axis, const uint chunk,
                 const uint end, const SweepParams params) {
  local const ushort* order = tree->orders[now][axis];
  Run run = {0, chunk * CHUNK, 0, 0, 0};
  while (find_run(tree, now, run.end, end, &run)) {
    // The sweep from the left, from the front of the node.
    float3 low = INFINITY, high = -INFINITY;
    if (run.first < run.begin) {
      for (uint c = run.first / CHUNK; c < chunk; ++c)
        extend_by_box(tree->tails, axis, c, &low, &high);
    }
    float3 positions[CHUNK];
    float costs[CHUNK];
    // Cuts before the photon at `begin` have `begin - first` photons on the left.
    uint units = units_of(run.begin - run.first, params);
    uint room = units * params.unit_size - (run.begin - run.first);
#pragma unroll
    for (uint j = 0; j < CHUNK; ++j) {
      if (run.begin + j >= run.end) continue;
      costs[j] = measure(low, high, params.measure) * (float)units;
      if (room == 0) {
        room = params.unit_size;
        ++units;
      }
      --room;
      positions[j] = position_of(tree, order[run.begin + j]);
      low = fmin(low, positions[j]);
      high = fmax(high, positions[j]);
    }
    // The sweep from the right.
    low = INFINITY;
    high = -INFINITY;
    if (run.last > run.end) {
      for (uint c = chunk + 1; c <= (run.last - 1) / CHUNK; ++c)
        extend_by_box(tree->heads, axis, c, &low, &high);
    }
    units = units_of(run.last - run.end, params);
    room = units * params.unit_size - (run.last - run.end);
    float best_cost = INFINITY;
    uint best_place = run.begin, best_imbalance = 0;
#pragma unroll
    for (uint back = 0; back < CHUNK; ++back) {
      const uint j = CHUNK - 1 - back, place = run.begin + j;
      if (place >= run.end) continue;
      low = fmin(low, positions[j]);
      high = fmax(high, positions[j]);
      if (room == 0) {
        room = params.unit_size;
        ++units;
      }
      --room;
      if (place == run.first) continue;
      const float cost = costs[j] + measure(low, high, params.measure) * (float)units;
      const uint imbalance = imbalance_of(place - run.first, run.last - run.first);
      if (!is_better(best_cost, best_imbalance, cost, imbalance)) {
        best_cost = cost;
        best_imbalance = imbalance;
        best_place = place;
      }
    }
    if (run.begin == run.first) {
      tree->node_costs[axis][run.node] = best_cost;
      tree->node_places[axis][run.node] = (ushort)best_place;
    } else {
      tree->chunk_costs[axis][chunk] = best_cost;
      tree->chunk_places[axis][chunk] = (ushort)best_place;
    }
  }
}

// Takes the best of the cuts that the chunks of a node found on one axis, the first of equals.
void merge_cuts(local Subtree* tree, const uint now, const uint axis, const uint node) {
  const uint first = tree->firsts[now][node], last = tree->lasts[now][node];
  float best_cost = tree->node_costs[axis][node];
  uint best_place = tree->node_places[axis][node];
  for (uint chunk = first / CHUNK + 1; chunk <= (last - 1) / CHUNK; ++chunk) {
    const float cost = tree->chunk_costs[axis][chunk];
    const uint place = tree->chunk_places[axis][chunk];
    if (is_better(cost, imbalance_of(place - first, last - first), best_cost,
                  imbalance_of(best_place - first, last - first))) {
      best_cost = cost;
      best_place = place;
    }
  }
  tree->node_costs[axis][node] = best_cost;
  tree->node_places[axis][node] = (ushort)best_place;
}

// The axis on which a node is cut; sets its place there where the node must be halved.
uint choose_axis(local Subtree* tree, const uint now, const uint node, const uint depth,
                 const SweepParams params) {
  const uint first = tree->firsts[now][node], last = tree->lasts[now][node];
  const uint count = last - first;
  const uint leaf_count = (count + params.max_leaf_size - 1) / params.max_leaf_size;
  const bool halves = 32 - clz(leaf_count - 1) + depth >= kMaxDepth;
  uint best = 0, best_imbalance = 0;
  float best_cost = INFINITY, best_extent = -1;
  for (uint axis = 0; axis < 3; ++axis) {
    local const ushort* order = tree->orders[now][axis];
    const float extent =
        tree->coordinates[axis][order[last - 1]] - tree->coordinates[axis][order[first]];
    const float cost = halves ? 0.0f : tree->node_costs[axis][node];
    const uint imbalance = halves ? 0 : imbalance_of(tree->node_places[axis][node] - first, count);
    if (is_better(cost, imbalance, best_cost, best_imbalance) ||
        (cost == best_cost && imbalance == best_imbalance && extent > best_extent)) {
      best = axis;
      best_cost = cost;
      best_imbalance = imbalance;
      best_extent = extent;
    }
  }
  if (halves)
    tree->node_places[best][node] = (ushort)(first + (leaf_count + 1) / 2 * params.max_leaf_size);
  return best;
}

// Lists places [begin, end) as a node of the next depth where they are more than a leaf. Returns its
// number, which depends on the order in which items come; nothing else does.
ushort list_node(local Subtree* tree, const uint next, const uint begin, const uint end,
                 const SweepParams params) {
  if (end - begin <= params.max_leaf_size) return NO_NODE;
  const uint node = atomic_inc(&tree->node_counts[next]);
  tree->firsts[next][node] = (ushort)begin;
  tree->lasts[next][node] = (ushort)end;
  return (ushort)node;
}

// Counts the photons that go right of the node that reaches over the chunk's back.
void count_chunk(local Subtree* tree, const uint now, const uint axis, const uint chunk,
                 const uint end) {
  const uint node = tree->node_of[end - 1];
  if (node == NO_NODE || tree->lasts[now][node] == end) return;
  uint rights = 0;
  for (uint i = max((uint)tree->firsts[now][node], chunk * CHUNK); i < end; ++i)
    rights += tree->goes_right[tree->orders[now][axis][i]];
  tree->tail_rights[axis][chunk] = (uchar)rights;
}

// Moves the photons of a chunk to the sides of their nodes, where they keep the order of the axis.
void move_chunk(local Subtree* tree, const uint now, const uint axis, const uint chunk,
                const uint end) {
  Run run = {0, chunk * CHUNK, 0, 0, 0};
  while (find_run(tree, now, run.end, end, &run)) {
    uint right = tree->node_places[tree->axes[run.node]][run.node];
    for (uint c = run.first / CHUNK; c < chunk; ++c) right += tree->tail_rights[axis][c];
    const uint rights_before = right - tree->node_places[tree->axes[run.node]][run.node];
    uint left = run.begin - rights_before;
    for (uint i = run.begin; i < run.end; ++i) {
      const uint slot = tree->orders[now][axis][i];
      const uint place = tree->goes_right[slot] != 0 ? right++ : left++;
      tree->orders[!now][axis][place] = (ushort)slot;
      if (axis == 0) tree->order[place] = (ushort)slot;
    }
  }
}

/// Rebuilds subtrees. One work-group per subtree, 1D range, any work-group size.
/// @param photons     [n] in leaf order of the tree that is rebuilt
/// @param firsts      [subtrees + 1] first photon of each subtree, at most SUBTREE_SIZE, then n
/// @param levels      [n - 1] in: between the subtrees; out: inside them
/// @param out         [n] in the new order
/// @param leaf_flags  [n + 1] out: 1 where a leaf begins, else 0; leaf_flags[n] is 0
kernel void sweep_subtrees(global const LeafPhoton* restrict photons,
                           global const uint* restrict firsts, const uint n,
                           const SweepParams params, global uchar* restrict levels,
                           global LeafPhoton* restrict out, global uint* restrict leaf_flags) {
  local Subtree tree;
  const uint item = get_local_id(0), items = get_local_size(0);
  const uint first = firsts[get_group_id(0)], count = firsts[get_group_id(0) + 1] - first;
  const uint padded = count > 1 ? 1u << (32 - clz(count - 1)) : 1;
  for (uint i = item; i < padded; i += items) {
    // Slots without a photon come last on every axis.
    const float4 photon =
        i < count ? load_photon(photons, first + i) : (float4)(INFINITY);
    tree.coordinates[0][i] = photon.x;
    tree.coordinates[1][i] = photon.y;
    tree.coordinates[2][i] = photon.z;
    for (uint axis = 0; axis < 3; ++axis) tree.orders[0][axis][i] = (ushort)i;
    tree.levels[i] = LEVEL_INSIDE;
    tree.node_of[i] = 0;
  }
  if (item == 0) {
    tree.firsts[0][0] = 0;
    tree.lasts[0][0] = (ushort)count;
    tree.node_counts[0] = count > params.max_leaf_size ? 1 : 0;
  }
  sort_axes(&tree, padded);

  // Levels from positions grow on every path: there are at most as many nodes above. After a cut by
  // place the photons are at one position, and are halved.
  const int left_level = first > 0 ? (int)levels[first - 1] : -1;
  const int right_level = first + count < n ? (int)levels[first + count - 1] : -1;
  const int cut_level = max(left_level, right_level);
  const uint start_depth = cut_level >= (int)kLevelIndex
                               ? (uint)kMaxDepth
                               : max((uint)(cut_level + 1), (uint)kMaxDepth - kSweepLevels);
  // The photons are sorted.
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = item; i < count; i += items) tree.order[i] = tree.orders[0][0][i];
  const uint tasks = 3 * CHUNKS;
  uint now = 0;
  for (uint depth = 0;; ++depth) {
    // The nodes are listed and their photons in order.
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint node_count = tree.node_counts[now];
    if (node_count == 0) break;
    for (uint task = item; task < tasks; task += items) {
      const uint chunk = task % CHUNKS, end = min((chunk + 1) * CHUNK, count);
      measure_chunk(&tree, now, task / CHUNKS, chunk, end);
    }
    if (item == 0) tree.node_counts[!now] = 0;
    // The boxes of all chunks are known.
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint task = item; task < tasks; task += items) {
      const uint chunk = task % CHUNKS, end = min((chunk + 1) * CHUNK, count);
      sweep_chunk(&tree, now, task / CHUNKS, chunk, end, params);
    }
    // The cuts of all chunks are found.
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint task = item; task < 3 * node_count; task += items)
      merge_cuts(&tree, now, task % 3, task / 3);
    // The best cuts of the axes are found, the list of the next depth is empty.
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint node = item; node < node_count; node += items) {
      const uint axis = choose_axis(&tree, now, node, start_depth + depth, params);
      const uint begin = tree.firsts[now][node], end = tree.lasts[now][node];
      const uint middle = tree.node_places[axis][node];
      tree.axes[node] = (uchar)axis;
      tree.levels[middle - 1] = (uchar)(kLevelSweep + depth);
      tree.left_nodes[node] = list_node(&tree, !now, begin, middle, params);
      tree.right_nodes[node] = list_node(&tree, !now, middle, end, params);
    }
    // The cuts are chosen.
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < count; i += items) {
      const uint node = tree.node_of[i];
      if (node == NO_NODE) continue;
      const uint axis = tree.axes[node];
      tree.goes_right[tree.orders[now][axis][i]] = i >= tree.node_places[axis][node] ? 1 : 0;
    }
    // Every photon knows its side.
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint task = item; task < tasks; task += items) {
      const uint chunk = task % CHUNKS, end = min((chunk + 1) * CHUNK, count);
      if (chunk * CHUNK < end) count_chunk(&tree, now, task / CHUNKS, chunk, end);
    }
    // The sides of all chunks are counted.
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint task = item; task < tasks; task += items) {
      const uint chunk = task % CHUNKS, end = min((chunk + 1) * CHUNK, count);
      move_chunk(&tree, now, task / CHUNKS, chunk, end);
    }
    // The photons have left their nodes.
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < count; i += items) {
      const uint node = tree.node_of[i];
      if (node == NO_NODE) continue;
      tree.node_of[i] = i >= tree.node_places[tree.axes[node]][node] ? tree.right_nodes[node]
                                                                     : tree.left_nodes[node];
    }
    now = !now;
  }
  for (uint i = item; i < count; i += items) {
    out[first + i] = photons[first + tree.order[i]];
    leaf_flags[first + i] = i == 0 || tree.levels[i - 1] != LEVEL_INSIDE ? 1 : 0;
    if (i + 1 < count) levels[first + i] = tree.levels[i];
  }
  if (item == 0 && first + count == n) leaf_flags[n] = 0;
}
