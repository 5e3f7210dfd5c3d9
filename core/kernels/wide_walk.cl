// What the kernels share in which 32 items walk the wide tree together for QUERIES neighbouring
// queries. Uses traverse.cl and sub_group.cl.
// -DQUERIES: of one sub-group.

#define EACH_QUERY _Pragma("unroll") for (uint j = 0; j < QUERIES; ++j)

// Loads the queries of the sub-group from `first_place` on, x, y, z and squared radius each, into
// `places` [QUERIES]. Behind the last of `query_count` comes the last again.
void load_places(const GatherParams params, const uint first_place, const uint query_count,
                 global const uint* restrict order, global const float* restrict positions,
                 global const float* restrict radii_in, local float4* places) {
  const uint lane = sub_group_lane();
  if (lane < QUERIES) {
    const uint query = query_at(params, order, first_place + min(lane, query_count - 1));
    const float radius = radius_of(params, query, radii_in);
    places[lane] = (float4)(vload3(query, positions), radius * radius);
  }
  sub_group_sync();
}
