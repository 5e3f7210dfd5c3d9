// What the gather kernels share: a query's place and radius, distances to boxes, and the outputs of
// every query.

// A candidate is one number that orders by (squared distance, photon index): squared distances are
// not negative, so their bits order as they do.
ulong candidate(const float d2, const uint id) { return ((ulong)as_uint(d2) << 32) | id; }

// A child that waits on the traversal stack: the bits of its squared distance above, its slot
// below. The slot, node * 2 for a left child and node * 2 + 1 for a right one, leads to its links
// and to its smallest photon index.
ulong pending(const float d2, const uint slot) { return ((ulong)as_uint(d2) << 32) | slot; }

// Squared distance from `q` to the box, 0 inside. Rounded as the distance to a photon is, in the
// same order of operations, so it is never above that of any photon of the box: culling by it is
// exact.
float box_squared_distance(const float3 q, const float3 low, const float3 high) {
  // Floats from 0 up are ordered as their bits are, and what is below 0 is below as both: integers
  // have an instruction for the largest of three.
  const int3 bits = max(max(as_int3(low - q), as_int3(q - high)), 0);
  const float3 d = as_float3(bits);
  return (d.x * d.x + d.y * d.y) + d.z * d.z;
}

// Squared distance from `q` to the farthest corner of the box; never below that of any photon of
// the box.
float far_squared_distance(const float3 q, const float3 low, const float3 high) {
  const float3 d = fmax(q - low, high - q);
  return (d.x * d.x + d.y * d.y) + d.z * d.z;
}

float photon_squared_distance(const float3 q, const float4 photon) {
  const float3 d = q - photon.xyz;
  return (d.x * d.x + d.y * d.y) + d.z * d.z;
}

// Both children of a node, as one 64-byte read.
typedef struct Children {
  float3 left_min, left_max, right_min, right_max;
  uint4 links;  // left, right, left_count, right_count
} Children;

Children load_children(global const Node* restrict nodes, const uint index) {
  global const float4* restrict words = (global const float4*)(nodes + index);
  const float4 a = words[0], b = words[1], c = words[2];
  Children children;
  children.left_min = a.xyz;
  children.left_max = (float3)(a.w, b.x, b.y);
  children.right_min = (float3)(b.z, b.w, c.x);
  children.right_max = c.yzw;
  children.links = as_uint4(words[3]);
  return children;
}

// Weight of a photon at squared distance d2 of a gather of squared radius r2, before the division
// by pi r2.
float density_weight(const uint kernel_type, const float d2, const float r2) {
  if (kernel_type == kKernelConstant) return 1.0f;
  if (kernel_type == kKernelCone) return fmax(3.0f * (1.0f - sqrt(d2 / r2)), 0.0f);
  return fmax(2.0f * (1.0f - d2 / r2), 0.0f);
}

// A direction from its octahedral coordinates (Cigolle et al. 2014), not normalised.
float3 decode_octahedral(const short2 direction) {
  const float step = 1.0f / 32767;
  float x = max((int)direction.x, -32767) * step, y = max((int)direction.y, -32767) * step;
  const float z = 1.0f - fabs(x) - fabs(y);
  if (z < 0) {
    const float folded = (1.0f - fabs(y)) * (x >= 0 ? 1.0f : -1.0f);
    y = (1.0f - fabs(x)) * (y >= 0 ? 1.0f : -1.0f);
    x = folded;
  }
  return (float3)(x, y, z);
}

// Whether light of this direction comes from the side of the normal.
bool comes_against(const float3 direction, const float3 normal) {
  return direction.x * normal.x + direction.y * normal.y + direction.z * normal.z < 0;
}

// A sum of many numbers, with what its roundings lost (Kahan 1965): its error does not grow with
// their number.
typedef struct LongSum {
  float3 sum, lost;
} LongSum;

void add_to(LongSum* sum, const float3 value) {
  const float3 rest = value - sum->lost;
  const float3 more = sum->sum + rest;
  // Nothing is known of what an infinite sum lost.
  sum->lost = select((float3)(0.0f), (more - sum->sum) - rest, isfinite(more));
  sum->sum = more;
}

// What the photon `id` adds to a density sum.
float3 weighted_power(const GatherParams params, const uint query, const uint id, const float d2,
                      const float r2, global const PhotonPower* restrict powers,
                      global const float* restrict normals) {
  const float4 power = ((global const float4*)powers)[id];
  if (params.has_normals &&
      !comes_against(decode_octahedral(as_short2(power.w)), vload3(query, normals)))
    return 0.0f;
  return density_weight(params.density_kernel, d2, r2) * power.xyz;
}

// Density of a channel's sum over a disc of squared radius r2; 0 where the disc has no area or no
// end.
float finish_channel(const float sum, const float r2) {
  return r2 > 0 && r2 < INFINITY ? sum / (M_PI_F * r2) : 0.0f;
}

float3 finish_density(const float3 sum, const float r2) {
  return (float3)(finish_channel(sum.x, r2), finish_channel(sum.y, r2), finish_channel(sum.z, r2));
}

// The query that is worked on at `place` of this launch.
uint query_at(const GatherParams params, global const uint* restrict order, const uint place) {
  const uint at = params.first + place;
  return params.has_order ? order[at] : at;
}

uint query_of(const GatherParams params, global const uint* restrict order) {
  return query_at(params, order, get_global_id(0));
}

float radius_of(const GatherParams params, const uint query, global const float* restrict radii) {
  return params.has_radii ? radii[query] : params.radius;
}
