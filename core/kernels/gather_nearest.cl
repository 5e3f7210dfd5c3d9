// The k nearest photons within a radius: depth-first, the nearer child first, the candidates in a
// heap (Jensen 2001, section 6.1.3), ties by photon index. Uses traverse.cl and heap.cl.
// -DAPPROXIMATE=1: (1 + epsilon)-nearest neighbours (Arya et al. 1998), or at most so many leaves.

#if HEAPS_GLOBAL
#define HEAP_ITEM get_global_id(0)
#define HEAP_STRIDE get_global_size(0)
#else
#define HEAP_ITEM get_local_id(0)
#define HEAP_STRIDE get_local_size(0)
#endif

// Whether a subtree can hold a candidate below `worst`: its best would be (d2, smallest index below
// it).
bool may_hold(const float d2, const ulong worst, global const uint* restrict min_id) {
  const uint bits = as_uint(d2), limit = (uint)(worst >> 32);
  return bits < limit || (bits == limit && *min_id < (uint)worst);
}

// Of APPROXIMATE alone: once there are k candidates, distances of subtrees are multiplied by
// `squared_stretch`; the nearest that might have been entered and is not is remembered.
typedef struct GivenUp {
  float squared_stretch, nearest;
} GivenUp;

// Whether a subtree is to be entered. `full`: there are k candidates.
bool worthwhile(const float d2, const ulong worst, const bool full,
                global const uint* restrict min_id, GivenUp* given_up) {
  if (!may_hold(d2, worst, min_id)) return false;
#if APPROXIMATE
  if (full && !may_hold(d2 * given_up->squared_stretch, worst, min_id)) {
    given_up->nearest = fmin(given_up->nearest, d2);
    return false;
  }
#endif
  return true;
}

// Goes back to the last subtree that waits and is to be entered. False: there is none.
bool go_back(const ulong* stack, uint* depth, const ulong worst, const bool full,
             global const Node* restrict nodes, global const uint* restrict min_ids,
             GivenUp* given_up, uint* link, uint* count) {
  while (*depth > 0) {
    const ulong entry = stack[--*depth];
    const uint slot = (uint)entry;
    if (!worthwhile(as_float((uint)(entry >> 32)), worst, full, min_ids + slot, given_up)) continue;
    global const Node* node = nodes + slot / 2;
    *link = (slot & 1) != 0 ? node->right : node->left;
    *count = (slot & 1) != 0 ? node->right_count : node->left_count;
    return true;
  }
  return false;
}

#if APPROXIMATE
// As NearestErrorBound of core/gatherer.h.
float nearest_error_bound(const bool full, const float farthest, const float given_up) {
  if (!full) return given_up < INFINITY ? INFINITY : 0.0f;
  if (!(given_up < farthest)) return 0.0f;
  return sqrt(farthest / given_up) * (1 + 0x1p-22f) - 1;
}
#endif

/// Gathers. One work-item per query, 1D range.
/// @param nodes         [node_count]
/// @param min_ids       [2 * node_count] smallest photon index below each left, right child
/// @param photons       [n] in leaf order
/// @param powers        [n] in order of index; read for kOutputDensity
/// @param positions     [3m] queries, scene units
/// @param order         [m] queries in the order of work; read where has_order
/// @param radii_in      [m] scene units; read where has_radii
/// @param normals       [3m] read where has_normals
/// @param counts, radii, densities, visited_out, tested_out  [m], [m], [3m], [m], [m] out, where
/// asked for
/// @param neighbor_ids, neighbor_d2  [m * k] out, where asked for: nearest first, padded
/// @param heaps         space of k candidates for each work-item, interleaved
/// @param error_bounds  [m] out
kernel void gather_nearest(global const Node* restrict nodes, global const uint* restrict min_ids,
                           global const LeafPhoton* restrict photons,
                           global const PhotonPower* restrict powers,
                           global const float* restrict positions,
                           global const uint* restrict order, global const float* restrict radii_in,
                           global const float* restrict normals, const GatherParams params,
                           global uint* restrict counts, global float* restrict radii,
                           global uint* restrict neighbor_ids, global float* restrict neighbor_d2,
                           global float* restrict densities, global uint* restrict visited_out,
                           global uint* restrict tested_out, HEAP_SPACE ulong* heaps
#if APPROXIMATE
                           ,
                           global float* restrict error_bounds
#endif
) {
  if (get_global_id(0) >= params.count) return;
  const uint query = query_of(params, order);
  const float3 q = vload3(query, positions);
  const float radius = radius_of(params, query, radii_in);
  HEAP_SPACE ulong* heap = heaps + HEAP_ITEM;
  const uint stride = HEAP_STRIDE;

  // A candidate must be below `worst`: at first anything within the radius, then what beats the
  // k-th.
  ulong worst = (ulong)(as_uint(radius * radius) + 1) << 32;
  uint size = 0, visited = 0, tested = 0;
  GivenUp given_up = {params.squared_stretch, INFINITY};
#if APPROXIMATE
  uint leaves_left = params.max_leaves;
#endif
  ulong stack[kMaxDepth];
  uint depth = 0;
  uint link = params.root.link, count = params.root.count;
  bool more = count > 0 && box_squared_distance(q, vload3(0, params.root.min),
                                                vload3(0, params.root.max)) <= radius * radius;
  while (more) {
    // Down to a leaf: items of a sub-group that are there wait for the others, so that leaves,
    // which cost most, are looked into together (Aila and Laine 2009).
    while (more && (link & kLeafBit) == 0) {
      ++visited;
      // Take the nearer child that may hold something, keep the other for later.
      const Children children = load_children(nodes, link);
      const uint slot = 2 * link;
      const bool full = size == params.k;
      const float left = box_squared_distance(q, children.left_min, children.left_max);
      const float right = box_squared_distance(q, children.right_min, children.right_max);
      const bool take_left = worthwhile(left, worst, full, min_ids + slot, &given_up);
      const bool take_right = worthwhile(right, worst, full, min_ids + slot + 1, &given_up);
      const bool left_first = take_left && (!take_right || left < right ||
                                            (left == right && min_ids[slot] < min_ids[slot + 1]));
      if (take_left && take_right)
        stack[depth++] = left_first ? pending(right, slot + 1) : pending(left, slot);
      link = left_first ? children.links.x : children.links.y;
      count = left_first ? children.links.z : children.links.w;
      if (!take_left && !take_right)
        more = go_back(stack, &depth, worst, full, nodes, min_ids, &given_up, &link, &count);
    }
    if (!more) break;
    // Try the photons of the leaf.
    ++visited;
    tested += count;
    for (uint i = 0; i < count; ++i) {
      const float4 photon = load_photon(photons, (link & ~kLeafBit) + i);
      const ulong value = candidate(photon_squared_distance(q, photon), as_uint(photon.w));
      if (value >= worst) continue;
      if (size < params.k) {
        sift_up(heap, stride, size++, value);
      } else {
        sift_down(heap, stride, size, value);
      }
      if (size == params.k) worst = heap[0];
    }
#if APPROXIMATE
    if (--leaves_left == 0) {
      // What waits may have held more.
      for (uint i = 0; i < depth; ++i) {
        const float d2 = as_float((uint)(stack[i] >> 32));
        if (may_hold(d2, worst, min_ids + (uint)stack[i]))
          given_up.nearest = fmin(given_up.nearest, d2);
      }
      break;
    }
#endif
    more =
        go_back(stack, &depth, worst, size == params.k, nodes, min_ids, &given_up, &link, &count);
  }

  // Write what is asked for.
  const bool full = size == params.k;
  const float r2 = full ? as_float((uint)(heap[0] >> 32)) : radius * radius;
#if APPROXIMATE
  error_bounds[query] = nearest_error_bound(full, r2, given_up.nearest);
#endif
  if (params.outputs & kOutputCount) counts[query] = size;
  if (params.outputs & kOutputRadius) radii[query] = full ? sqrt(r2) : radius;
  if (params.outputs & kOutputStatistics) {
    visited_out[query] = visited;
    tested_out[query] = tested;
  }
  if (params.outputs & kOutputDensity) {
    LongSum sum = {0.0f, 0.0f};
    for (uint i = 0; i < size; ++i) {
      const ulong value = heap[i * stride];
      add_to(&sum, weighted_power(params, query, (uint)value, as_float((uint)(value >> 32)), r2,
                                  powers, normals));
    }
    vstore3(finish_density(sum.sum, r2), query, densities);
  }
  if (params.outputs & kOutputNeighbors) {
    sort_heap(heap, stride, size);
    for (uint i = 0; i < params.k; ++i) {
      const size_t place = (size_t)query * params.k + i;
      const ulong value = i < size ? heap[i * stride] : candidate(INFINITY, kNoPhoton);
      neighbor_ids[place] = (uint)value;
      neighbor_d2[place] = as_float((uint)(value >> 32));
    }
  }
}
