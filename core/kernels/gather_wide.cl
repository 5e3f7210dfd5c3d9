// The k nearest photons within a radius, by sub-groups: 32 items walk the wide tree together for
// QUERIES neighbouring queries, one child or one photon to an item. Candidates are appended to a
// list in local memory; a full list is cut at a bound that a bisection over the bits of the
// distances finds. Uses traverse.cl, sub_group.cl and wide_tree.cl.
// -DQUERIES: of one sub-group. -DLIST_ROWS: places of a list / 32; k is at most (LIST_ROWS - 2)
// * 32. -DSUB_GROUPS: of one work-group.

#define LIST_SIZE (LIST_ROWS * SUB_GROUP_SIZE)
#define LIST_KEPT (LIST_SIZE - 2 * SUB_GROUP_SIZE)  // at most so many are left when a list is cut
#define NOTHING 0xffffffffu                         // no child: above the bits of any distance

// A query and its candidates, in local memory. A candidate is not above (worst_d2, worst_id).
typedef struct Seeker {
  float4 place;  // x, y, z, worst_d2
  uint worst_id, size;
  float limit;  // squared radius
} Seeker;

// Candidates of one item: places lane, 32 + lane, ... of a list.
typedef struct Rows {
  uint d2[LIST_ROWS], id[LIST_ROWS];
} Rows;

Rows load_rows(local const uint* d2, local const uint* id, const uint size) {
  Rows rows;
  for (uint r = 0; r < LIST_ROWS; ++r) {
    const uint place = r * SUB_GROUP_SIZE + sub_group_lane();
    rows.d2[r] = place < size ? d2[place] : NOTHING;
    rows.id[r] = place < size ? id[place] : NOTHING;
  }
  return rows;
}

bool not_above(const uint d2, const uint id, const uint bound_d2, const uint bound_id) {
  return d2 < bound_d2 || (d2 == bound_d2 && id <= bound_id);
}

// How many candidates are not above the bound.
uint count_below(const Rows rows, const uint bound_d2, const uint bound_id) {
  uint count = 0;
  for (uint r = 0; r < LIST_ROWS; ++r)
    count += not_above(rows.d2[r], rows.id[r], bound_d2, bound_id) ? 1 : 0;
  return sub_group_add(count);
}

// Lowers the bound of the seeker until at least `k` and at most `most` candidates are not above it,
// and drops those that are above. There are more than `most`, which is not below k.
void cut_list(local Seeker* seeker, local uint* d2, local uint* id, const uint k, const uint most) {
  // The list is complete.
  sub_group_sync();
  const Rows rows = load_rows(d2, id, seeker->size);
  uint left = seeker->size;
  // Bisect the distance: low has less than k, high at least k, `left` of them. The k-th is near the
  // largest mostly, so the first steps go down from there by halves of the distance.
  uint low = NOTHING, high = as_uint(seeker->place.w), high_id = NOTHING - 1;
  for (uint step = 1u << 23; left > most && low == NOTHING && step < high; step *= 2) {
    const uint count = count_below(rows, high - step, NOTHING);
    if (count >= k) {
      high -= step;
      left = count;
    } else {
      low = high - step;
    }
  }
  while (left > most && high - low > 1) {  // modulo 2^32: NOTHING is -1
    const uint middle = low + (high - low) / 2;
    const uint count = count_below(rows, middle, NOTHING);
    if (count >= k) {
      high = middle;
      left = count;
    } else {
      low = middle;
    }
  }
  // Of equal distances take the smallest indices.
  for (uint low_id = NOTHING; left > most && high_id - low_id > 1;) {
    const uint middle = low_id + (high_id - low_id) / 2;
    const uint count = count_below(rows, high, middle);
    if (count >= k) {
      high_id = middle;
      left = count;
    } else {
      low_id = middle;
    }
  }
  uint size = 0;
  const uint before = (1u << sub_group_lane()) - 1;
  for (uint r = 0; r < LIST_ROWS; ++r) {
    const bool stays = not_above(rows.d2[r], rows.id[r], high, high_id);
    const uint votes = sub_group_vote(stays);
    if (stays) {
      const uint place = size + popcount(votes & before);
      d2[place] = rows.d2[r];
      id[place] = rows.id[r];
    }
    size += popcount(votes);
  }
  if (sub_group_lane() == 0) {
    seeker->place.w = as_float(high);
    seeker->worst_id = high_id;
    seeker->size = size;
  }
  sub_group_sync();
}

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

// Largest distance bound of the seekers in `active`.
float farthest_bound(local const Seeker* seekers, const uint active) {
  float farthest = 0;
  for (uint rest = active; rest != 0; rest &= rest - 1)
    farthest = fmax(farthest, seekers[ctz(rest)].place.w);
  return farthest;
}

// Writes the neighbours in order, each item the rank of its own candidates, and pads the rest.
void write_neighbors(local const uint* d2, local const uint* id, const uint size, const uint k,
                     global uint* restrict ids_out, global float* restrict d2_out) {
  const Rows rows = load_rows(d2, id, size);
  uint rank[LIST_ROWS];
  uint ranks = 0;
  for (uint r = 0; r < LIST_ROWS; ++r) rank[r] = 0;
  for (uint i = 0; i < size; ++i) {
    const uint other = d2[i];
    for (uint r = 0; r < LIST_ROWS - 2; ++r) rank[r] += other < rows.d2[r] ? 1 : 0;
  }
  for (uint r = 0; r < LIST_ROWS - 2; ++r)
    ranks += r * SUB_GROUP_SIZE + sub_group_lane() < size ? rank[r] : 0;
  if (sub_group_add(ranks) != size * (size - 1) / 2) {
    // Some distances are equal: their indices decide.
    for (uint i = 0; i < size; ++i) {
      const uint other = d2[i], other_id = id[i];
      for (uint r = 0; r < LIST_ROWS - 2; ++r)
        rank[r] += other == rows.d2[r] && other_id < rows.id[r] ? 1 : 0;
    }
  }
  for (uint r = 0; r < LIST_ROWS - 2; ++r) {
    if (r * SUB_GROUP_SIZE + sub_group_lane() >= size) continue;
    ids_out[rank[r]] = rows.id[r];
    d2_out[rank[r]] = as_float(rows.d2[r]);
  }
  for (uint i = size + sub_group_lane(); i < k; i += SUB_GROUP_SIZE) {
    ids_out[i] = kNoPhoton;
    d2_out[i] = INFINITY;
  }
}

/// Gathers. One sub-group per QUERIES queries, 1D range of SUB_GROUPS * 32 * any; arguments as
/// gather_nearest.
/// @param boxes  [..] the wide tree, level by level as `wide` says
kernel __attribute__((reqd_work_group_size(SUB_GROUPS * SUB_GROUP_SIZE, 1, 1))) void gather_wide(
    global const WideBox* restrict boxes, const WideTree wide,
    global const LeafPhoton* restrict photons, global const float* restrict powers,
    global const short2* restrict directions, global const float* restrict positions,
    global const uint* restrict order, global const float* restrict radii_in,
    global const float* restrict normals, const GatherParams params, global uint* restrict counts,
    global float* restrict radii, global uint* restrict neighbor_ids,
    global float* restrict neighbor_d2, global float* restrict densities) {
  local Seeker all_seekers[SUB_GROUPS * QUERIES];
  local uint all_d2[SUB_GROUPS * QUERIES * LIST_SIZE], all_ids[SUB_GROUPS * QUERIES * LIST_SIZE];
  local uint all_keys[SUB_GROUPS * (kMaxWideLevels - 1) * SUB_GROUP_SIZE];
  const uint lane = sub_group_lane(), sub_group = get_local_id(0) / SUB_GROUP_SIZE;
  local Seeker* seekers = all_seekers + sub_group * QUERIES;
  local uint* list_d2 = all_d2 + sub_group * QUERIES * LIST_SIZE;
  local uint* list_ids = all_ids + sub_group * QUERIES * LIST_SIZE;
  local uint* keys = all_keys + sub_group * (kMaxWideLevels - 1) * SUB_GROUP_SIZE;

  const uint first_place = (get_group_id(0) * SUB_GROUPS + sub_group) * QUERIES;
  if (first_place >= params.count) return;
  const uint query_count = min(params.count - first_place, (uint)QUERIES);
  if (lane < query_count) {
    const uint place = params.first + first_place + lane;
    const uint query = params.has_order ? order[place] : place;
    const float3 q = vload3(query, positions);
    const float radius = radius_of(params, query, radii_in);
    seekers[lane] = (Seeker){(float4)(q, radius * radius), NOTHING, 0, radius * radius};
  }
  sub_group_sync();
  uint active = (1u << query_count) - 1;
  float farthest = farthest_bound(seekers, active);
  uint guesses = 0;
  uint level = wide.level_count, first = 0;  // first child looked at, of that level
  uint key = NOTHING, touching = 0, begin = 0, end = 0;
  float extent = 0;
  bool enter = true;
  while (true) {
    if (enter) {
      // Look at 32 children: how near is each to the nearest query that it may serve?
      --level;
      const uint child = first + lane;
      float3 center = 0.0f;
      key = NOTHING;
      touching = 0;
      if (child < wide.counts[level]) {
        global const float4* words = (global const float4*)(boxes + wide.offsets[level] + child);
        const float4 low = words[0], high = words[1];
        center = 0.5f * low.xyz + 0.5f * high.xyz;
        extent = (high.x - low.x) + (high.y - low.y) + (high.z - low.z);
        begin = as_uint(high.w);
        if (level == 0) end = boxes[child + 1].first;
        for (uint rest = active; rest != 0; rest &= rest - 1) {
          const uint j = ctz(rest);
          const Seeker seeker = seekers[j];
          const float d2 = box_squared_distance(seeker.place.xyz, low.xyz, high.xyz);
          if (not_above(as_uint(d2), as_uint(low.w), as_uint(seeker.place.w), seeker.worst_id)) {
            key = min(key, as_uint(d2));
            touching |= 1u << j;
          }
        }
      }
      if (level == 0 && guesses == 0) {
        // The first blocks seen tell about how far to look.
        guesses = 1;
        const bool has_block = child < wide.counts[0];
        for (uint j = 0; j < query_count; ++j) {
          const Seeker seeker = seekers[j];
          const float3 to_center = seeker.place.xyz - center;
          const float d2 = dot(to_center, to_center);
          const uint block_size = has_block ? end - begin : 0;
          // Where the radius reaches few blocks it is as good as a guess.
          if (sub_group_add((touching >> j & 1) != 0 ? block_size : 0) < 4 * params.k) continue;
          const float guess = guess_squared_radius(d2, block_size, params.k);
          if (lane == 0 && guess < 0.5f * seeker.limit) seekers[j].place.w = guess;
        }
        sub_group_sync();
        farthest = farthest_bound(seekers, active);
      }
      enter = false;
    }
    // The nearest first.
    const uint nearest = sub_group_min(key);
    if (nearest == NOTHING || nearest > as_uint(farthest)) {
      if (++level == wide.level_count) {
        // Where a guess was too low, look again: four times as far, then without a guess.
        active = 0;
        for (uint j = 0; j < query_count; ++j) {
          const Seeker seeker = seekers[j];
          if (seeker.size < params.k && seeker.place.w < seeker.limit) active |= 1u << j;
        }
        if (active == 0) break;
        // All have read the seekers before any changes.
        sub_group_sync();
        if ((active >> lane & 1) != 0) {
          seekers[lane].place.w = guesses == 1
                                      ? fmin(4 * seekers[lane].place.w, seekers[lane].limit)
                                      : seekers[lane].limit;
          seekers[lane].worst_id = NOTHING;
          seekers[lane].size = 0;
        }
        sub_group_sync();
        ++guesses;
        farthest = farthest_bound(seekers, active);
        enter = true;
        first = 0;
        continue;
      }
      key = keys[(level - 1) * SUB_GROUP_SIZE + lane];
      extent = 0;
      first = first / SUB_GROUP_SIZE / SUB_GROUP_SIZE * SUB_GROUP_SIZE;
      continue;
    }
    uint candidates = sub_group_vote(key == nearest);
    if ((candidates & (candidates - 1)) != 0 && level > 0) {
      // Of several that hold a query the smallest: what fills it is nearest.
      const uint own = key == nearest ? as_uint(extent) : NOTHING;
      candidates = sub_group_vote(own == sub_group_min(own));
    }
    const uint chosen = ctz(candidates);
    if (lane == chosen) key = NOTHING;
    if (level > 0) {
      keys[(level - 1) * SUB_GROUP_SIZE + lane] = key;  // read again by this item alone
      first = (first + chosen) * SUB_GROUP_SIZE;
      enter = true;
      continue;
    }
    // Try the photons of a block on the queries that it touches.
    const uint serves = sub_group_broadcast(touching, chosen);
    const uint block_begin = sub_group_broadcast(begin, chosen);
    const uint block_end = sub_group_broadcast(end, chosen);
    bool cut = false;
    for (uint base = block_begin; base < block_end; base += SUB_GROUP_SIZE) {
      const bool valid = base + lane < block_end;
      const float4 photon =
          valid ? vload4(base + lane, (global const float*)photons) : (float4)(0.0f);
      for (uint rest = serves; rest != 0; rest &= rest - 1) {
        const uint j = ctz(rest);
        const Seeker seeker = seekers[j];
        const uint d2 = as_uint(photon_squared_distance(seeker.place.xyz, photon));
        const bool takes =
            valid && not_above(d2, as_uint(photon.w), as_uint(seeker.place.w), seeker.worst_id);
        const uint votes = sub_group_vote(takes);
        if (votes == 0) continue;
        if (takes) {
          const uint place = j * LIST_SIZE + seeker.size + popcount(votes & ((1u << lane) - 1));
          list_d2[place] = d2;
          list_ids[place] = as_uint(photon.w);
        }
        const uint size = seeker.size + popcount(votes);
        // Every item has read the seeker: the vote came after.
        if (lane == 0) seekers[j].size = size;
        if (size > LIST_SIZE - SUB_GROUP_SIZE) {
          cut_list(&seekers[j], list_d2 + j * LIST_SIZE, list_ids + j * LIST_SIZE, params.k,
                   LIST_KEPT);
          cut = true;
        }
      }
      // The sizes are written before the next photons are tried.
      sub_group_sync();
    }
    if (cut) farthest = farthest_bound(seekers, active);
  }

  for (uint j = 0; j < query_count; ++j) {
    local uint *d2 = list_d2 + j * LIST_SIZE, *ids = list_ids + j * LIST_SIZE;
    if (seekers[j].size > params.k) cut_list(&seekers[j], d2, ids, params.k, params.k);
    const uint place = params.first + first_place + j;
    const uint query = params.has_order ? order[place] : place;
    const float radius = radius_of(params, query, radii_in);
    const uint size = seekers[j].size;
    float r2 = radius * radius;
    if (size == params.k) {
      uint farthest_d2 = 0;
      for (uint i = lane; i < size; i += SUB_GROUP_SIZE) farthest_d2 = max(farthest_d2, d2[i]);
      r2 = as_float(sub_group_max(farthest_d2));
    }
    if (lane == 0) {
      if (params.outputs & kOutputCount) counts[query] = size;
      if (params.outputs & kOutputRadius) radii[query] = size == params.k ? sqrt(r2) : radius;
    }
    if (params.outputs & kOutputDensity) {
      float3 sum = 0.0f;
      for (uint i = lane; i < size; i += SUB_GROUP_SIZE) {
        add_density(&sum, params, query, ids[i], as_float(d2[i]), r2, powers, directions, normals);
      }
      sum.x = sub_group_sum(sum.x);
      sum.y = sub_group_sum(sum.y);
      sum.z = sub_group_sum(sum.z);
      if (lane == 0) vstore3(finish_density(sum, r2), query, densities);
    }
    if (params.outputs & kOutputNeighbors) {
      const size_t begin_out = (size_t)query * params.k;
      write_neighbors(d2, ids, size, params.k, neighbor_ids + begin_out, neighbor_d2 + begin_out);
    }
  }
}
