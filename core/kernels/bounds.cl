// Tight box of all photons, in two launches: each work-group reduces a part, then one work-group
// reduces the parts. Minimum and maximum do not depend on the order, so neither does the box.

#ifndef GROUP_SIZE
#define GROUP_SIZE 256
#endif

// Reduces the boxes of a work-group's items to item 0.
void reduce_box(local float* shared_min, local float* shared_max, float3* low, float3* high) {
  const uint item = get_local_id(0);
  vstore3(*low, item, shared_min);
  vstore3(*high, item, shared_max);
  for (uint half_size = GROUP_SIZE / 2; half_size > 0; half_size /= 2) {
    // The items of the round before wrote what is read now.
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < half_size) {
      *low = fmin(*low, vload3(item + half_size, shared_min));
      *high = fmax(*high, vload3(item + half_size, shared_max));
      vstore3(*low, item, shared_min);
      vstore3(*high, item, shared_max);
    }
  }
}

/// Reduces the photons to one box per work-group. 1D range of GROUP_SIZE * any.
/// @param positions  [3n] x, y, z of each photon, scene units
/// @param boxes      [6 * groups] out: minimum, maximum
kernel void bounds_of_photons(global const float* restrict positions, const uint n,
                              global float* restrict boxes) {
  local float shared_min[3 * GROUP_SIZE], shared_max[3 * GROUP_SIZE];
  float3 low = INFINITY, high = -INFINITY;
  for (uint i = get_global_id(0); i < n; i += get_global_size(0)) {
    const float3 p = load_position(positions, i);
    low = fmin(low, p);
    high = fmax(high, p);
  }
  reduce_box(shared_min, shared_max, &low, &high);
  if (get_local_id(0) == 0) {
    vstore3(low, 2 * get_group_id(0), boxes);
    vstore3(high, 2 * get_group_id(0) + 1, boxes);
  }
}

// As MakeMortonGrid of core/model/morton_grid.h, the same bits.
MortonGrid make_morton_grid(const float3 low, const float3 high, const float cells) {
  const float3 extent = high - low;
  const float longest = fmax(fmax(fmax(extent.x, extent.y), extent.z), 0.0f);
  MortonGrid grid;
  grid.prescale = longest < 0x1p-60f ? 0x1p96f : 1.0f;
  const float scale = longest > 0 ? cells / (longest * grid.prescale) : 0.0f;
  vstore3(longest > 0 ? low : (float3)(0.0f), 0, grid.min);
  vstore3((float3)(scale), 0, grid.scale);
  return grid;
}

/// Reduces boxes to one, and makes the grids of Morton codes over it. One work-group of GROUP_SIZE.
/// @param boxes    [6 * count] minimum, maximum
/// @param bounds   [6] out: minimum, maximum, scene units
/// @param grid_30  [1] out: of 30-bit codes
/// @param grid_63  [1] out: of 63-bit codes
kernel void bounds_of_boxes(global const float* restrict boxes, const uint count,
                            global float* restrict bounds, global MortonGrid* restrict grid_30,
                            global MortonGrid* restrict grid_63) {
  local float shared_min[3 * GROUP_SIZE], shared_max[3 * GROUP_SIZE];
  float3 low = INFINITY, high = -INFINITY;
  for (uint i = get_local_id(0); i < count; i += GROUP_SIZE) {
    low = fmin(low, vload3(2 * i, boxes));
    high = fmax(high, vload3(2 * i + 1, boxes));
  }
  reduce_box(shared_min, shared_max, &low, &high);
  if (get_local_id(0) == 0) {
    vstore3(low, 0, bounds);
    vstore3(high, 1, bounds);
    *grid_30 = make_morton_grid(low, high, 0x1p10f);
    *grid_63 = make_morton_grid(low, high, 0x1p21f);
  }
}
