// The k nearest photons within a radius for k beyond the lists of gather_wide: 32 items walk the
// wide tree for one query, one child or one photon to an item. Uses traverse.cl, sub_group.cl,
// long_list.cl and the tree of wide_tree.cl.
// -DSUB_GROUPS: of one work-group.

// A squared radius that holds about k photons or more of those in 32 boxes, one to an item:
// the photons of a box are taken to lie evenly in the squared distance, which puts too few of them
// near a query among them. INFINITY where there are too few in all.
float guess_squared_radius(const float near, const float far, const uint count, const uint k) {
  if (sub_group_add(count) < k) return INFINITY;
  uint high = sub_group_max(count > 0 ? as_uint(far) : 0);
  const uint low_of_item = count > 0 ? as_uint(near) : high;
  // Far below the largest distance a guess need not be a good one: lists will bound the search.
  uint low = max(sub_group_min(low_of_item), high - min(high, 24u << 23));
  const float part = native_divide((float)count, far - near);
  for (uint i = 0; i < 12 && high - low > 1; ++i) {
    const uint middle = low + (high - low) / 2;
    // Not NaN where the box is a point.
    const float within = fmin(fmax((as_float(middle) - near) * part, 0.0f), (float)count);
    if (sub_group_add((uint)within) >= k) {
      high = middle;
    } else {
      low = middle;
    }
  }
  return as_float(high);
}

// Photons of a box of a level, the boxes of blocks are level 0.
uint photons_below(global const WideBox* restrict boxes, const WideTree wide, uint level,
                   const uint box) {
  uint begin = boxes[wide.offsets[level] + box].first;
  uint end = boxes[wide.offsets[level] + box + 1].first;
  while (level-- > 0) {
    begin = boxes[wide.offsets[level] + begin].first;
    end = boxes[wide.offsets[level] + end].first;
  }
  return end - begin;
}

/// Gathers. One sub-group per query, 1D range of SUB_GROUPS * 32 * any; arguments as gather_wide.
/// @param list_size  places of each list, a multiple of 32, more than 64 beyond k or all photons
/// @param all_lists  [SUB_GROUPS * list_size]
kernel __attribute__((reqd_work_group_size(SUB_GROUPS * SUB_GROUP_SIZE, 1, 1))) void gather_long(
    global const WideBox* restrict boxes, const WideTree wide,
    global const WideSizes* restrict sizes, global const LeafPhoton* restrict photons,
    global const PhotonPower* restrict powers, global const float* restrict positions,
    global const uint* restrict order, global const float* restrict radii_in,
    global const float* restrict normals, const GatherParams params, global uint* restrict counts,
    global float* restrict radii, global uint* restrict neighbor_ids,
    global float* restrict neighbor_d2, global float* restrict densities, const uint list_size,
    local ulong* all_lists) {
  local uint all_waiting[SUB_GROUPS * (kMaxWideLevels - 1) * SUB_GROUP_SIZE];
  local uint all_firsts[SUB_GROUPS * kMaxWideLevels];
  const uint lane = sub_group_lane();
  const uint sub_group = sub_group_max(get_local_id(0) / SUB_GROUP_SIZE);
  local ulong* list = all_lists + sub_group * list_size;
  // Squared distances of the children that wait at each level. Written and read by the same item.
  local uint* waiting = all_waiting + sub_group * (kMaxWideLevels - 1) * SUB_GROUP_SIZE + lane;
  local uint* firsts = all_firsts + sub_group * kMaxWideLevels;  // of each level's children

  const uint place = get_group_id(0) * SUB_GROUPS + sub_group;
  if (place >= params.count) return;
  const uint query = query_at(params, order, place);
  const float3 q = vload3(query, positions);
  const float radius = radius_of(params, query, radii_in);
  const uint limit = sub_group_max(as_uint(radius * radius));
  // A candidate must not be above `worst`, whose distance is `reach`.
  ulong worst = candidate(as_float(limit), NOTHING);
  uint reach = limit, size = 0, guesses = 0;
  const uint most = params.k + (list_size - params.k) / 4;  // are left when the list is cut
  const uint level_count = sizes->level_count, top_count = sizes->counts[level_count - 1];
  uint level = level_count, first = 0, count = top_count;  // of the children looked at
  while (true) {
    --level;
    uint key = NOTHING, begin = 0, end = 0;
    float extent = 0, far = 0;
    if (lane < count) {
      global const WideBox* box = boxes + wide.offsets[level] + first + lane;
      const float4 low = ((global const float4*)box)[0], high = ((global const float4*)box)[1];
      const float d2 = box_squared_distance(q, low.xyz, high.xyz);
      if (candidate(d2, as_uint(low.w)) <= worst) key = as_uint(d2);
      far = far_squared_distance(q, low.xyz, high.xyz);
      extent = (high.x - low.x) + (high.y - low.y) + (high.z - low.z);
      begin = as_uint(high.w);
      if (level == 0) end = box[1].first;
    }
    if (level == 1 && guesses == 0) {
      // The first nodes of blocks seen tell about how far to look.
      guesses = 1;
      const uint held = key != NOTHING ? photons_below(boxes, wide, level, first + lane) : 0;
      const float guess = guess_squared_radius(as_float(key), far, held, params.k);
      if (guess < 0.5f * as_float(reach)) {
        reach = sub_group_max(as_uint(guess));
        worst = candidate(as_float(reach), NOTHING);
      }
    }
    if (level == 0) {
      // Blocks that are neighbours are looked into as one.
      for (uint blocks = sub_group_vote(key <= reach); blocks != 0;) {
        const uint run = ctz(blocks);
        const uint run_end = run + ctz(~(blocks >> run));
        uint base = sub_group_max(lane == run ? begin : 0);
        const uint photons_end = sub_group_max(lane + 1 == run_end ? end : 0);
        for (; base < photons_end; base += SUB_GROUP_SIZE) {
          const float4 photon = load_photon(photons, min(base + lane, photons_end - 1));
          const ulong value = candidate(photon_squared_distance(q, photon), as_uint(photon.w));
          const bool takes = base + lane < photons_end && value <= worst;
          const uint votes = sub_group_vote(takes);
          if (takes) list[size + popcount(votes & items_before())] = value;
          size += popcount(votes);
          if (size <= list_size - SUB_GROUP_SIZE) continue;
          // The list is complete.
          sub_group_sync();
          worst = find_bound(list, size, params.k, most);
          reach = sub_group_max((uint)(worst >> 32));
          size = drop_above(list, size, worst);
        }
        blocks = run_end < SUB_GROUP_SIZE ? sub_group_vote(key <= reach) >> run_end << run_end : 0;
      }
    }
    // The nearest node that waits, of the lowest level that has one.
    uint nearest = level > 0 ? sub_group_min(key) : NOTHING;
    while (nearest > reach && ++level < level_count) {
      key = waiting[(level - 1) * SUB_GROUP_SIZE];
      first = firsts[level];
      extent = 0;
      nearest = sub_group_min(key);
    }
    if (level >= level_count) {
      // Where a guess was too low, look again: four times as far, then without a guess.
      if (size >= params.k || reach == limit) break;
      reach = guesses == 1 ? min(as_uint(4 * as_float(reach)), limit) : limit;
      worst = candidate(as_float(reach), NOTHING);
      size = 0;
      ++guesses;
      level = level_count;
      first = 0;
      count = top_count;
      continue;
    }
    uint candidates = sub_group_vote(key == nearest);
    if ((candidates & (candidates - 1)) != 0) {
      // Of several that hold the query the smallest: what fills it is nearest.
      const uint own = key == nearest ? as_uint(extent) : NOTHING;
      candidates = sub_group_vote(own == sub_group_min(own));
    }
    const uint chosen = 31 - clz(candidates);
    if (lane == chosen) key = NOTHING;
    waiting[(level - 1) * SUB_GROUP_SIZE] = key;
    firsts[level] = first;  // the same from all items
    global const WideBox* node = boxes + wide.offsets[level] + first + chosen;
    first = node[0].first;
    count = node[1].first - first;
  }

  // The list is complete.
  sub_group_sync();
  if (size > params.k) size = drop_above(list, size, find_bound(list, size, params.k, params.k));
  const bool full = size == params.k;
  const float r2 = full ? as_float(largest_distance(list, size)) : radius * radius;
  if (lane == 0) {
    if (params.outputs & kOutputCount) counts[query] = size;
    if (params.outputs & kOutputRadius) radii[query] = full ? sqrt(r2) : radius;
  }
  if (params.outputs & kOutputDensity) {
    LongSum sum = {0.0f, 0.0f};
    for (uint i = lane; i < size; i += SUB_GROUP_SIZE) {
      const ulong value = list[i];
      add_to(&sum, weighted_power(params, query, (uint)value, as_float((uint)(value >> 32)), r2,
                                  powers, normals));
    }
    const float density = finish_channel(sub_group_sum_each(sum.sum), r2);
    if (lane < 3) densities[3 * query + lane] = density;
  }
  if (params.outputs & kOutputNeighbors) {
    const Bins bins = make_bins(list, size, list_size);
    if (bins.count == 0) sort_long_list(list, size);
    for (uint i = lane; i < params.k; i += SUB_GROUP_SIZE) {
      ulong value = candidate(INFINITY, kNoPhoton);
      uint place_of_value = i;
      if (i < size) {
        value = list[bins.count > 0 ? bins.members[i] : i];
        if (bins.count > 0) place_of_value = rank_in_bins(bins, list, value);
      }
      const size_t out = (size_t)query * params.k + place_of_value;
      neighbor_ids[out] = (uint)value;
      neighbor_d2[out] = as_float((uint)(value >> 32));
    }
  }
}
