// How many photons lie within a radius, by sub-groups: 32 items walk the wide tree together for
// QUERIES neighbouring queries, one child or one photon to an item, each item with counts of its
// own. Uses traverse.cl, sub_group.cl, wide_walk.cl and the tree of wide_tree.cl.
// -DQUERIES: of one sub-group. -DSUB_GROUPS: of one work-group.

/// Counts. One sub-group per QUERIES queries, 1D range of SUB_GROUPS * 32 * any; arguments as
/// gather_wide.
kernel __attribute__((reqd_work_group_size(SUB_GROUPS * SUB_GROUP_SIZE, 1, 1))) void count_wide(
    global const WideBox* restrict boxes, const WideTree wide,
    global const WideSizes* restrict sizes, global const LeafPhoton* restrict photons,
    global const float* restrict positions, global const uint* restrict order,
    global const float* restrict radii_in, const GatherParams params, global uint* restrict counts,
    global float* restrict radii) {
  local uint all_waiting[SUB_GROUPS * kMaxWideLevels], all_firsts[SUB_GROUPS * kMaxWideLevels];
  local float4 all_places[SUB_GROUPS * QUERIES];  // x, y, z, squared radius
  const uint lane = sub_group_lane();
  const uint sub_group = sub_group_max(get_local_id(0) / SUB_GROUP_SIZE);
  // The children that wait at each level, as bits, and the first of them; the same from all items.
  local uint* waiting = all_waiting + sub_group * kMaxWideLevels;
  local uint* firsts = all_firsts + sub_group * kMaxWideLevels;
  local float4* places = all_places + sub_group * QUERIES;

  const uint first_place = (get_group_id(0) * SUB_GROUPS + sub_group) * QUERIES;
  if (first_place >= params.count) return;
  const uint query_count = min(params.count - first_place, (uint)QUERIES);
  load_places(params, first_place, query_count, order, positions, radii_in, places);
  float4 q[QUERIES];
  uint found[QUERIES];  // by this item
  float smallest = INFINITY;
  EACH_QUERY {
    q[j] = places[j];
    found[j] = 0;
    smallest = fmin(smallest, q[j].w);
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
      if (level == 0) {
        begin = as_uint(high.w);
        end = box[1].first;
        const float3 sides = high.xyz - low.xyz;
        if (touched && dot(sides, sides) <= smallest) {
          // A small block may lie within all radii that it touches: counted without its photons.
          bool whole = true;
          EACH_QUERY {
            whole &= far_squared_distance(q[j].xyz, low.xyz, high.xyz) <= q[j].w ||
                     box_squared_distance(q[j].xyz, low.xyz, high.xyz) > q[j].w;
          }
          if (whole) {
            EACH_QUERY if (box_squared_distance(q[j].xyz, low.xyz, high.xyz) <= q[j].w) found[j] +=
                end - begin;
            touched = false;
          }
        }
      }
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
          const bool valid = base + lane < photons_end;
          EACH_QUERY found[j] +=
              valid && photon_squared_distance(q[j].xyz, photon) <= q[j].w ? 1 : 0;
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
  uint own = 0;  // of query `lane`
  EACH_QUERY {
    const uint sum = sub_group_add(found[j]);
    if (lane == j) own = sum;
  }
  if (lane >= query_count) return;
  const uint query = query_at(params, order, first_place + lane);
  if (params.outputs & kOutputCount) counts[query] = own;
  if (params.outputs & kOutputRadius) radii[query] = radius_of(params, query, radii_in);
}
