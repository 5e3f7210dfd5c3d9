// The k nearest photons within a radius, by sub-groups: 32 items walk the wide tree together for
// QUERIES neighbouring queries, one child or one photon to an item. Candidates are appended to a
// list for each query; a full list is cut. Queries, bounds and lengths of lists are in registers,
// the same for all items: loops over queries are unrolled. Uses traverse.cl, sub_group.cl,
// wide_walk.cl, candidate_list.cl and the tree of wide_tree.cl.
// -DQUERIES: of one sub-group, k is at most (LIST_ROWS - 2) * 32. -DSUB_GROUPS: of one work-group.

#define LIST_KEPT (LIST_SIZE - 2 * SUB_GROUP_SIZE)  // at most so many are left when a list is cut

// Guesses the squared radius that holds somewhat more than k photons: from 32 blocks near the
// query, those with the nearest centres. Each item has one block of `count` photons and centre at
// squared distance `d2`, or none.
float guess_squared_radius(const float d2, const uint count, const uint k) {
  const uint wanted = k + k / 4;
  const uint bits = count > 0 ? as_uint(d2) : NOTHING;
  if (sub_group_add(count) < wanted) return INFINITY;
  uint low = sub_group_min(bits) - 1, high = sub_group_max(count > 0 ? bits : 0);
  for (uint i = 0; i < 10 && high - low > 1; ++i) {
    const uint middle = low + (high - low) / 2;
    if (sub_group_add(bits <= middle ? count : 0) >= wanted) {
      high = middle;
    } else {
      low = middle;
    }
  }
  return as_float(high);
}

// Squared distance from the box to the nearest query that may have use for it; INFINITY: none has.
// `careful`: of boxes just at the bound those alone with an index that is small enough.
float squared_reach(const float3* q, const float* worst, local const uint* worst_ids,
                    const bool careful, const float4 low, const float4 high) {
  float reach = INFINITY;
  if (!careful) {
    EACH_QUERY {
      const float d2 = box_squared_distance(q[j], low.xyz, high.xyz);
      reach = d2 <= worst[j] ? fmin(reach, d2) : reach;
    }
  } else {
    EACH_QUERY {
      const float d2 = box_squared_distance(q[j], low.xyz, high.xyz);
      if (d2 < worst[j] || (d2 == worst[j] && as_uint(low.w) <= worst_ids[j]))
        reach = fmin(reach, d2);
    }
  }
  return reach;
}

// The same bits in a register of the whole sub-group: conditions on it need no votes.
uint reach_of_all(const float farthest) { return sub_group_max(as_uint(farthest)); }

/// Gathers. One sub-group per QUERIES queries, 1D range of SUB_GROUPS * 32 * any; arguments as
/// gather_nearest.
/// @param boxes  [..] the wide tree, level by level as `wide` says
/// @param sizes  [1]
kernel __attribute__((reqd_work_group_size(SUB_GROUPS * SUB_GROUP_SIZE, 1, 1))) void gather_wide(
    global const WideBox* restrict boxes, const WideTree wide,
    global const WideSizes* restrict sizes, global const LeafPhoton* restrict photons,
    global const PhotonPower* restrict powers, global const float* restrict positions,
    global const uint* restrict order, global const float* restrict radii_in,
    global const float* restrict normals, const GatherParams params, global uint* restrict counts,
    global float* restrict radii, global uint* restrict neighbor_ids,
    global float* restrict neighbor_d2, global float* restrict densities) {
  local float4 all_places[SUB_GROUPS * QUERIES];  // x, y, z, squared radius
  local uint all_worst_ids[SUB_GROUPS * QUERIES];
  local uint2 all_lists[SUB_GROUPS * QUERIES * LIST_SIZE];
  local uint all_waiting[SUB_GROUPS * (kMaxWideLevels - 1) * SUB_GROUP_SIZE];
  local uint all_firsts[SUB_GROUPS * kMaxWideLevels];
  const uint lane = sub_group_lane();
  const uint sub_group = sub_group_max(get_local_id(0) / SUB_GROUP_SIZE);
  local float4* places = all_places + sub_group * QUERIES;
  local uint* worst_ids = all_worst_ids + sub_group * QUERIES;
  const uint lists = sub_group * QUERIES * LIST_SIZE;
  // Squared distances of the children that wait at each level. Written and read by the same item.
  local uint* waiting = all_waiting + sub_group * (kMaxWideLevels - 1) * SUB_GROUP_SIZE + lane;
  local uint* firsts = all_firsts + sub_group * kMaxWideLevels;  // of each level's children
  const uint before = (1u << lane) - 1;

  const uint first_place = (get_group_id(0) * SUB_GROUPS + sub_group) * QUERIES;
  if (first_place >= params.count) return;
  const uint query_count = min(params.count - first_place, (uint)QUERIES);
  if (lane < QUERIES) worst_ids[lane] = NOTHING;
  load_places(params, first_place, query_count, order, positions, radii_in, places);
  float3 q[QUERIES];
  float worst[QUERIES];  // squared; below 0: of a query that is done
  uint tail[QUERIES];    // where the list ends among all_lists
  float farthest = 0;
  EACH_QUERY {
    q[j] = places[j].xyz;
    worst[j] = j < query_count ? places[j].w : -1.0f;
    tail[j] = lists + j * LIST_SIZE;
    farthest = fmax(farthest, worst[j]);
  }
  uint reach = reach_of_all(farthest);
  uint guesses = 0;
  bool careful = false;
  const uint level_count = sizes->level_count, top_count = sizes->counts[level_count - 1];
  uint level = level_count, first = 0, count = top_count;  // of the children looked at
  while (true) {
    --level;
    uint key = NOTHING, begin = 0, end = 0;
    float extent = 0;
    if (lane < count) {
      global const WideBox* box = boxes + wide.offsets[level] + first + lane;
      const float4 low = ((global const float4*)box)[0], high = ((global const float4*)box)[1];
      const float d2 = squared_reach(q, worst, worst_ids, careful, low, high);
      if (d2 < INFINITY) key = as_uint(d2);
      extent = (high.x - low.x) + (high.y - low.y) + (high.z - low.z);
      begin = as_uint(high.w);
      if (level == 0) end = box[1].first;
    }
    if (level == 0) {
      if (guesses == 0) {
        // The first blocks seen tell about how far to look.
        guesses = 1;
        const uint size = end - begin;
        // Where the radius leaves out some of them it is as good as a guess.
        const uint reached = sub_group_add(key != NOTHING ? size : 0);
        if (reached >= 8 * params.k ||
            (reached >= 4 * params.k && reached >= sub_group_add(size) / 8 * 7)) {
          float3 center = 0.0f;
          if (size > 0) {
            global const WideBox* box = boxes + first + lane;
            center = 0.5f * vload3(0, box->min) + 0.5f * vload3(0, box->max);
          }
          farthest = 0;
          EACH_QUERY {
            const float3 to_center = q[j] - center;
            const float guess = guess_squared_radius(dot(to_center, to_center), size, params.k);
            if (guess < 0.5f * worst[j]) worst[j] = guess;
            farthest = fmax(farthest, worst[j]);
          }
          reach = reach_of_all(farthest);
        }
      }
      for (uint blocks = sub_group_vote(key <= reach); blocks != 0;) {
        // Blocks that are neighbours are looked into as one: their photons are tried on all
        // queries.
        const uint run = ctz(blocks), run_end = run + ctz(~(blocks >> run));
        uint base = sub_group_max(lane == run ? begin : 0);
        const uint photons_end = sub_group_max(lane + 1 == run_end ? end : 0);
        for (; base < photons_end; base += SUB_GROUP_SIZE) {
          const float4 photon = load_photon(photons, min(base + lane, photons_end - 1));
          uint longest = 0;
          EACH_QUERY {
            const float d2 = photon_squared_distance(q[j], photon);
            const bool takes = base + lane < photons_end && d2 <= worst[j];
            const uint votes = sub_group_vote(takes);
            if (takes)
              all_lists[tail[j] + popcount(votes & before)] =
                  (uint2)(as_uint(d2), as_uint(photon.w));
            tail[j] += popcount(votes);
            longest = max(longest, tail[j] - j * LIST_SIZE);
          }
          if (longest <= lists + LIST_SIZE - SUB_GROUP_SIZE) continue;
          farthest = 0;
          bool ties = false;
          for (uint i = 0; i < QUERIES; ++i) {
            Bound bound;
            const uint begin_of_list = lists + i * LIST_SIZE;
            EACH_QUERY if (j == i) bound = (Bound){worst[j], NOTHING, tail[j] - begin_of_list};
            if (bound.length > LIST_SIZE - SUB_GROUP_SIZE) {
              bound = cut_list(bound.length, all_lists + begin_of_list, params.k, LIST_KEPT);
              if (lane == 0) worst_ids[i] = bound.id;
              ties |= bound.id != NOTHING;
              EACH_QUERY if (j == i) worst[j] = bound.d2, tail[j] = begin_of_list + bound.length;
            }
            farthest = fmax(farthest, bound.d2);
          }
          reach = reach_of_all(farthest);
          if (ties) {
            // Of boxes just at the bound, those without smaller indices are of no use from now on.
            careful = true;
            sub_group_sync();
            if (key != NOTHING) {
              global const float4* words = (global const float4*)(boxes + first + lane);
              const float d2 = squared_reach(q, worst, worst_ids, careful, words[0], words[1]);
              if (d2 == INFINITY) key = NOTHING;
            }
          }
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
      farthest = -1;
      EACH_QUERY {
        const float limit = places[j].w;
        const uint length = tail[j] - (lists + j * LIST_SIZE);
        if (worst[j] >= 0 && length < params.k && worst[j] < limit) {
          worst[j] = guesses == 1 ? fmin(4 * worst[j], limit) : limit;
          worst_ids[j] = NOTHING;
          tail[j] = lists + j * LIST_SIZE;
          farthest = fmax(farthest, worst[j]);
        } else {
          worst[j] = -1;
        }
      }
      if (sub_group_vote(farthest >= 0) == 0) break;
      reach = reach_of_all(farthest);
      ++guesses;
      // The bounds' indices are written.
      sub_group_sync();
      level = level_count;
      first = 0;
      count = top_count;
      continue;
    }
    uint candidates = sub_group_vote(key == nearest);
    if ((candidates & (candidates - 1)) != 0) {
      // Of several that hold a query the smallest: what fills it is nearest.
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

  for (uint i = 0; i < query_count; ++i) {
    uint found = 0;
    EACH_QUERY if (j == i) found = tail[j] - (lists + j * LIST_SIZE);
    uint2 sorted[SORTED_ROWS];
    sort_list(all_lists + lists + i * LIST_SIZE, found, params.k, sorted);
    found = min(found, params.k);
    const uint query = query_at(params, order, first_place + i);
    const float radius = radius_of(params, query, radii_in);
    float r2 = radius * radius;
    if (found == params.k) {
      uint last = 0;
      for (uint r = 0; r < SORTED_ROWS; ++r)
        if (r == (found - 1) / SUB_GROUP_SIZE) last = sorted[r].x;
      r2 = as_float(sub_group_broadcast(last, (found - 1) % SUB_GROUP_SIZE));
    }
    if (lane == 0) {
      if (params.outputs & kOutputCount) counts[query] = found;
      if (params.outputs & kOutputRadius) radii[query] = found == params.k ? sqrt(r2) : radius;
    }
    if (params.outputs & kOutputDensity) {
      float3 sum = 0.0f;
      for (uint r = 0; r < SORTED_ROWS; ++r) {
        if (r * SUB_GROUP_SIZE + lane < found)
          sum += weighted_power(params, query, sorted[r].y, as_float(sorted[r].x), r2, powers,
                                normals);
      }
      const float density = finish_channel(sub_group_sum_each(sum), r2);
      if (lane < 3) densities[3 * query + lane] = density;
    }
    if (params.outputs & kOutputNeighbors) {
      for (uint r = 0; r < SORTED_ROWS; ++r) {
        const uint n = r * SUB_GROUP_SIZE + lane;
        if (n >= params.k) break;
        const size_t out = (size_t)query * params.k + n;
        neighbor_ids[out] = n < found ? sorted[r].y : kNoPhoton;
        neighbor_d2[out] = n < found ? as_float(sorted[r].x) : INFINITY;
      }
    }
  }
}
