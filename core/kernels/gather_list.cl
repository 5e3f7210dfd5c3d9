// Lists of all photons within a radius, for queries whose counts are known. Uses traverse.cl and
// heap.cl, whose heaps are in global memory.

/// Writes the candidates of each query, nearest first. One work-item per query, 1D range; arguments
/// as gather_nearest.
/// @param offsets     [m] where the list of each query begins
/// @param candidates  [sum of counts] out: squared distance's bits << 32 | photon index
kernel void gather_list(global const Node* restrict nodes,
                        global const LeafPhoton* restrict photons,
                        global const float* restrict positions, global const uint* restrict order,
                        global const float* restrict radii_in, const GatherParams params,
                        global const ulong* restrict offsets, global ulong* restrict candidates) {
  if (get_global_id(0) >= params.count) return;
  const uint query = query_of(params, order);
  const float3 q = vload3(query, positions);
  const float radius = radius_of(params, query, radii_in), r2 = radius * radius;
  global ulong* heap = candidates + offsets[query];
  uint size = 0;
  uint stack[kMaxDepth];
  uint depth = 0;
  uint link = params.root.link, count = params.root.count;
  bool more = count > 0 &&
              box_squared_distance(q, vload3(0, params.root.min), vload3(0, params.root.max)) <= r2;
  while (more) {
    bool descend = false;
    if ((link & kLeafBit) != 0) {
      for (uint i = 0; i < count; ++i) {
        const float4 photon = load_photon(photons, (link & ~kLeafBit) + i);
        const float d2 = photon_squared_distance(q, photon);
        if (d2 <= r2) sift_up(heap, 1, size++, candidate(d2, as_uint(photon.w)));
      }
    } else {
      const Children children = load_children(nodes, link);
      const bool take_left = box_squared_distance(q, children.left_min, children.left_max) <= r2;
      const bool take_right = box_squared_distance(q, children.right_min, children.right_max) <= r2;
      if (take_left && take_right) stack[depth++] = link;
      descend = take_left || take_right;
      link = take_left ? children.links.x : children.links.y;
      count = take_left ? children.links.z : children.links.w;
    }
    if (!descend && depth > 0) {
      global const Node* node = nodes + stack[--depth];
      link = node->right;
      count = node->right_count;
      descend = true;
    }
    more = descend;
  }
  sort_heap(heap, 1, size);
}
