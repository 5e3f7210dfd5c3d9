// Densities of all photons within a radius, where a subtree that lies within it whole is added up
// at once: the kernel is taken as a line in the squared distance, and a line over a subtree is a
// sum of its moments (core/cpu/whole_sum.h). Uses traverse.cl.

// As LinearWeight of core/cpu/whole_sum.h.
typedef struct LinearWeight {
  float constant_part, slope, error;
} LinearWeight;

// The line for squared distances of near_s to far_s, relative to the squared radius.
LinearWeight linearise(const uint kernel_type, const float near_s, const float far_s) {
  if (kernel_type == kKernelConstant) return (LinearWeight){1, 0, 0};
  if (kernel_type == kKernelEpanechnikov) return (LinearWeight){2, -2, 0};
  const float a = sqrt(near_s), b = sqrt(far_s), sum = a + b;
  if (sum == 0) return (LinearWeight){3, 0, 0};
  const float error = (b - a) * (b - a) / (8 * sum);
  return (LinearWeight){3 * (1 - a * b / sum - error), -3 / sum, 3 * error};
}

// Adds weight * power of a subtree; returns how far each channel may be from the kernel's.
float add_whole(LongSum* sum, global const PowerMoments* restrict moments, const float3 q,
                const float3 low, const float3 high, const float radius,
                const LinearWeight weight) {
  const float scale = 1 / radius;
  const float3 sides = high - low;
  const float unit = ((sides.x + sides.y) + sides.z) * scale;
  const float3 u = (0.5f * low + 0.5f * high - q) * scale;
  const float squared = (u.x * u.x + u.y * u.y) + u.z * u.z;
  float added[3];
  for (uint c = 0; c < 3; ++c) {
    global const float* m = moments->channels[c];
    const float first = (u.x * m[1] + u.y * m[2]) + u.z * m[3];
    const float s = (squared * m[0] + 2 * unit * first) + unit * unit * m[4];
    added[c] = weight.constant_part * m[0] + weight.slope * s;
  }
  add_to(sum, vload3(0, added));
  return weight.error * moments->absolute;
}

// Whether a subtree, whose box is so near and so far, may be added up.
bool is_summed(const GatherParams params, const float near, const float far, const float r2,
               LinearWeight* weight) {
  if (!(far <= r2) || r2 == 0) return false;
  *weight = linearise(params.density_kernel, near / r2, far / r2);
  return weight->error <= params.largest_weight_error;
}

/// Gathers. One work-item per query, 1D range; arguments as gather_range.
/// @param moments       [2 * node_count] of the left, the right child of each node
/// @param error_bounds  [m] out: of each channel of the density
kernel void gather_sums(global const Node* restrict nodes,
                        global const PowerMoments* restrict moments,
                        global const LeafPhoton* restrict photons,
                        global const PhotonPower* restrict powers,
                        global const float* restrict positions, global const uint* restrict order,
                        global const float* restrict radii_in, const GatherParams params,
                        global uint* restrict counts, global float* restrict radii,
                        global float* restrict densities, global uint* restrict visited_out,
                        global uint* restrict tested_out, global float* restrict error_bounds) {
  if (get_global_id(0) >= params.count) return;
  const uint query = query_of(params, order);
  const float3 q = vload3(query, positions);
  const float radius = radius_of(params, query, radii_in), r2 = radius * radius;
  uint found = 0, visited = 0, tested = 0;
  LongSum sum = {0.0f, 0.0f};
  float error = 0;
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
        add_to(&sum, density_weight(params.density_kernel, d2, r2) *
                         ((global const float4*)powers)[as_uint(photon.w)].xyz);
      }
    } else {
      const Children children = load_children(nodes, link);
      const float left = box_squared_distance(q, children.left_min, children.left_max);
      const float right = box_squared_distance(q, children.right_min, children.right_max);
      bool take_left = left <= r2, take_right = right <= r2;
      LinearWeight weight;
      if (take_left &&
          is_summed(params, left, far_squared_distance(q, children.left_min, children.left_max), r2,
                    &weight)) {
        error += add_whole(&sum, moments + 2 * link, q, children.left_min, children.left_max,
                           radius, weight);
        found += children.links.z;
        take_left = false;
      }
      if (take_right &&
          is_summed(params, right, far_squared_distance(q, children.right_min, children.right_max),
                    r2, &weight)) {
        error += add_whole(&sum, moments + 2 * link + 1, q, children.right_min, children.right_max,
                           radius, weight);
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
  vstore3(finish_density(sum.sum, r2), query, densities);
  error_bounds[query] = finish_density((float3)(error), r2).x;
  if (params.outputs & kOutputStatistics) {
    visited_out[query] = visited;
    tested_out[query] = tested;
  }
}
