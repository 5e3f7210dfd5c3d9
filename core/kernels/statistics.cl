// Sums over a tree that tell its quality, in one launch: each work-group writes its part, the host
// adds the parts.

#ifndef GROUP_SIZE
#define GROUP_SIZE 256
#endif

float half_area(const float3 extent) {
  return extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
}

// About 1 / longest edge of the root grown by `radius`, so that areas neither overflow nor vanish.
float area_scale(const Root root, const float radius) {
  const float longest = fmax(fmax(root.max[0] - root.min[0], root.max[1] - root.min[1]),
                             root.max[2] - root.min[2]) +
                        2.0f * radius;
  return longest > 0 ? fmin(1.0f / longest, 0x1p100f) : 0.0f;
}

/// Sums the surface areas of all children, the depths of all leaves, and the blocks. 1D range of
/// GROUP_SIZE * kTreeSumGroups.
/// @param climbs       [node_count + 1] of hierarchy.cl: their sum is the sum of the leaves' depths
/// @param block_flags  [node_count + 1] of hierarchy.cl
/// @param root         [1] of hierarchy.cl
/// @param radius       gather radius, scene units
/// @param sums         [1] out: in an order of addition that is the same on every device
kernel void tree_sums(global const Node* restrict nodes, const uint node_count,
                      global const ulong* restrict climbs, global const uint* restrict block_flags,
                      global const Root* restrict root, const float radius,
                      global TreeSums* restrict sums) {
  local float shared_areas[GROUP_SIZE], shared_grown[GROUP_SIZE];
  local ulong shared_depths[GROUP_SIZE];
  local uint shared_blocks[GROUP_SIZE];
  const uint item = get_local_id(0);
  const float scale = area_scale(*root, 0.0f), grown_scale = area_scale(*root, radius);
  const float grow = 2.0f * radius * grown_scale;
  float area = 0, grown = 0;
  ulong depth = 0;
  uint blocks = 0;
  for (uint i = get_global_id(0); i <= node_count; i += get_global_size(0)) {
    depth += climbs[i];
    blocks += block_flags[i];
    if (i == node_count) continue;
    global const Node* node = nodes + i;
    const float3 left = vload3(0, node->left_max) - vload3(0, node->left_min);
    const float3 right = vload3(0, node->right_max) - vload3(0, node->right_min);
    area += half_area(left * scale) + half_area(right * scale);
    grown += half_area(left * grown_scale + grow) + half_area(right * grown_scale + grow);
  }
  shared_areas[item] = area;
  shared_grown[item] = grown;
  shared_depths[item] = depth;
  shared_blocks[item] = blocks;
  for (uint half_size = GROUP_SIZE / 2; half_size > 0; half_size /= 2) {
    // The items of the round before wrote what is read now.
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < half_size) {
      shared_areas[item] += shared_areas[item + half_size];
      shared_grown[item] += shared_grown[item + half_size];
      shared_depths[item] += shared_depths[item + half_size];
      shared_blocks[item] += shared_blocks[item + half_size];
    }
  }
  if (item == 0) {
    sums->areas[get_group_id(0)] = shared_areas[0];
    sums->grown_areas[get_group_id(0)] = shared_grown[0];
    sums->depths[get_group_id(0)] = shared_depths[0];
    sums->blocks[get_group_id(0)] = shared_blocks[0];
    if (get_group_id(0) == 0) sums->root = *root;
  }
}
