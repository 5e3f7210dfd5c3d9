// All photons within a radius: counts and densities, without a list. Uses traverse.cl.

/// Gathers. One work-item per query, 1D range; arguments as gather_nearest, without neighbours.
/// A subtree that lies within the radius whole is counted by its size where no density is asked
/// for.
kernel void gather_range(global const Node* restrict nodes,
                         global const LeafPhoton* restrict photons,
                         global const PhotonPower* restrict powers,
                         global const float* restrict positions, global const uint* restrict order,
                         global const float* restrict radii_in,
                         global const float* restrict normals, const GatherParams params,
                         global uint* restrict counts, global float* restrict radii,
                         global float* restrict densities, global uint* restrict visited_out,
                         global uint* restrict tested_out) {
  if (get_global_id(0) >= params.count) return;
  const uint query = query_of(params, order);
  const float3 q = vload3(query, positions);
  const float radius = radius_of(params, query, radii_in), r2 = radius * radius;
  const bool sums = (params.outputs & kOutputDensity) != 0;
  uint found = 0, visited = 0, tested = 0;
  LongSum sum = {0.0f, 0.0f};
  uint stack[kMaxDepth];
  uint depth = 0;
  uint link = params.root.link, count = params.root.count;
  bool more = count > 0 &&
              box_squared_distance(q, vload3(0, params.root.min), vload3(0, params.root.max)) <= r2;
  while (more) {
    ++visited;
    bool descend = false;
    if ((link & kLeafBit) != 0) {
      tested += count;
      for (uint i = 0; i < count; ++i) {
        const float4 photon = load_photon(photons, (link & ~kLeafBit) + i);
        const float d2 = photon_squared_distance(q, photon);
        if (d2 > r2) continue;
        ++found;
        if (sums)
          add_to(&sum, weighted_power(params, query, as_uint(photon.w), d2, r2, powers, normals));
      }
    } else {
      const Children children = load_children(nodes, link);
      bool take_left = box_squared_distance(q, children.left_min, children.left_max) <= r2;
      bool take_right = box_squared_distance(q, children.right_min, children.right_max) <= r2;
      if (!sums && take_left &&
          far_squared_distance(q, children.left_min, children.left_max) <= r2) {
        found += children.links.z;
        take_left = false;
      }
      if (!sums && take_right &&
          far_squared_distance(q, children.right_min, children.right_max) <= r2) {
        found += children.links.w;
        take_right = false;
      }
      if (take_left && take_right) stack[depth++] = link;
      descend = take_left || take_right;
      const uint4 links = children.links;
      link = take_left ? links.x : links.y;
      count = take_left ? links.z : links.w;
    }
    if (!descend && depth > 0) {
      // The left child was taken first.
      global const Node* node = nodes + stack[--depth];
      link = node->right;
      count = node->right_count;
      descend = true;
    }
    more = descend;
  }
  if (params.outputs & kOutputCount) counts[query] = found;
  if (params.outputs & kOutputRadius) radii[query] = radius;
  if (sums) vstore3(finish_density(sum.sum, r2), query, densities);
  if (params.outputs & kOutputStatistics) {
    visited_out[query] = visited;
    tested_out[query] = tested;
  }
}
