// Sums over a tree that tell its quality, in one launch: each work-group writes its part, the host
// adds the parts.

#ifndef GROUP_SIZE
#define GROUP_SIZE 256
#endif

float relative_area(const float3 extent) {
  return 2.0f * (extent.x * extent.y + extent.y * extent.z + extent.z * extent.x);
}

/// Sums the surface areas of all children and the depths of all leaves. 1D range of GROUP_SIZE *
/// any.
/// @param scale   about 1 / longest edge of the root, so that areas neither overflow nor vanish
/// @param climbs  [node_count + 1] of hierarchy.cl: their sum is the sum of the leaves' depths
/// @param areas   [groups] out: in an order of addition that depends on the number of groups alone
/// @param depths  [groups] out
kernel void tree_sums(global const Node* restrict nodes, const uint node_count, const float scale,
                      global const ulong* restrict climbs, global float* restrict areas,
                      global ulong* restrict depths) {
  local float shared_areas[GROUP_SIZE];
  local ulong shared_depths[GROUP_SIZE];
  const uint item = get_local_id(0);
  float area = 0;
  ulong depth = get_global_id(0) == 0 ? climbs[node_count] : 0;
  for (uint i = get_global_id(0); i < node_count; i += get_global_size(0)) {
    global const Node* node = nodes + i;
    area += relative_area((vload3(0, node->left_max) - vload3(0, node->left_min)) * scale);
    area += relative_area((vload3(0, node->right_max) - vload3(0, node->right_min)) * scale);
    depth += climbs[i];
  }
  shared_areas[item] = area;
  shared_depths[item] = depth;
  for (uint half_size = GROUP_SIZE / 2; half_size > 0; half_size /= 2) {
    // The items of the round before wrote what is read now.
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < half_size) {
      shared_areas[item] += shared_areas[item + half_size];
      shared_depths[item] += shared_depths[item + half_size];
    }
  }
  if (item == 0) {
    areas[get_group_id(0)] = shared_areas[0];
    depths[get_group_id(0)] = shared_depths[0];
  }
}
