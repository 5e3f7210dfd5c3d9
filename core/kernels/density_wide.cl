// Densities of all photons within a radius, by sub-groups: 32 items walk the wide tree together for
// QUERIES neighbouring queries, one child or one photon to an item, each item with sums of its own.
// Uses traverse.cl, sub_group.cl, wide_walk.cl and the tree of wide_tree.cl.
// -DQUERIES: of one sub-group. -DSUB_GROUPS: of one work-group.

/// Gathers. One sub-group per QUERIES queries, 1D range of SUB_GROUPS * 32 * any; arguments as
/// gather_wide, without neighbours.
kernel __attribute__((reqd_work_group_size(SUB_GROUPS * SUB_GROUP_SIZE, 1, 1))) void density_wide(
    global const WideBox* restrict boxes, const WideTree wide,
    global const WideSizes* restrict sizes, global const LeafPhoton* restrict photons,
    global const PhotonPower* restrict powers, global const float* restrict positions,
    global const uint* restrict order, global const float* restrict radii_in,
    global const float* restrict normals, const GatherParams params, global uint* restrict counts,
    global float* restrict radii, global float* restrict densities) {
  local uint all_waiting[SUB_GROUPS * kMaxWideLevels], all_firsts[SUB_GROUPS * kMaxWideLevels];
  local float4 all_places[SUB_GROUPS * QUERIES];  // x, y, z, squared radius
  local float4 all_facings[SUB_GROUPS * QUERIES];  // normals
  const uint lane = sub_group_lane();
  const uint sub_group = sub_group_max(get_local_id(0) / SUB_GROUP_SIZE);
  // The children that wait at each level, as bits, and the first of them; the same from all items.
  local uint* waiting = all_waiting + sub_group * kMaxWideLevels;
  local uint* firsts = all_firsts + sub_group * kMaxWideLevels;
  local float4* places = all_places + sub_group * QUERIES;
  local float4* facings = all_facings + sub_group * QUERIES;

  const uint first_place = (get_group_id(0) * SUB_GROUPS + sub_group) * QUERIES;
  if (first_place >= params.count) return;
  const uint query_count = min(params.count - first_place, (uint)QUERIES);
  load_places(params, first_place, query_count, order, positions, radii_in, places);
  if (params.has_normals) {
    if (lane < query_count)
      facings[lane].xyz = vload3(query_at(params, order, first_place + lane), normals);
    sub_group_sync();
  }
  float4 q[QUERIES];
  uint found[QUERIES];    // by this item
  LongSum sums[QUERIES];  // likewise
  EACH_QUERY {
    q[j] = places[j];
    found[j] = 0;
    sums[j] = (LongSum){0.0f, 0.0f};
  }
  const uint level_count = sizes->level_count;
  uint level = level_count, first = 0, count = sizes->counts[level_count - 1];
  while (true) {
    --level;
    bool touched = false;
    uint begin = 0, end = 0;
    if (lane < count) {
      global const WideBox* box = boxes + wide.offsets[level] + first + lane;
      const float4 low = ((global const float4*)box)[0], high = ((global const float4*)box)[1];
      EACH_QUERY touched |= box_squared_distance(q[j].xyz, low.xyz, high.xyz) <= q[j].w;
      begin = as_uint(high.w);
      if (level == 0) end = box[1].first;
    }
    uint children = sub_group_vote(touched);
    if (level == 0) {
      while (children != 0) {
        // Blocks that are neighbours are looked into as one.
        const uint run = ctz(children), run_end = run + ctz(~(children >> run));
        uint base = sub_group_max(lane == run ? begin : 0);
        const uint photons_end = sub_group_max(lane + 1 == run_end ? end : 0);
        children = run_end < SUB_GROUP_SIZE ? children >> run_end << run_end : 0;
        for (; base < photons_end; base += SUB_GROUP_SIZE) {
          const float4 photon = load_photon(photons, min(base + lane, photons_end - 1));
          float d2[QUERIES];
          bool any = false;
          EACH_QUERY {
            d2[j] = photon_squared_distance(q[j].xyz, photon);
            if (base + lane >= photons_end) d2[j] = NAN;
            any |= d2[j] <= q[j].w;
          }
          if (!any) continue;
          const float4 power = ((global const float4*)powers)[as_uint(photon.w)];
          const float3 direction = decode_octahedral(as_short2(power.w));
          EACH_QUERY {
            if (d2[j] <= q[j].w) {
              ++found[j];
              if (params.has_normals && !comes_against(direction, facings[j].xyz)) continue;
              add_to(&sums[j], density_weight(params.density_kernel, d2[j], q[j].w) * power.xyz);
            }
          }
        }
      }
    }
    while (children == 0 && ++level < level_count) {
      // The same for all items, and known to be.
      children = sub_group_max(waiting[level]);
      first = firsts[level];
    }
    if (level >= level_count) break;
    const uint chosen = ctz(children);
    waiting[level] = children & (children - 1);
    firsts[level] = first;
    global const WideBox* node = boxes + wide.offsets[level] + first + chosen;
    first = node[0].first;
    count = node[1].first - first;
  }
  for (uint i = 0; i < query_count; ++i) {
    float3 sum = 0.0f;
    uint own = 0;
    EACH_QUERY if (j == i) sum = sums[j].sum, own = found[j];
    const uint total = sub_group_add(own);
    const uint query = query_at(params, order, first_place + i);
    const float density = finish_channel(sub_group_sum_each(sum), places[i].w);
    if (lane < 3) densities[3 * query + lane] = density;
    if (lane > 0) continue;
    if (params.outputs & kOutputCount) counts[query] = total;
    if (params.outputs & kOutputRadius) radii[query] = radius_of(params, query, radii_in);
  }
}
