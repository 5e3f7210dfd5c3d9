#ifndef TREELIGHT_CORE_MODEL_POWER_MOMENTS_H_
#define TREELIGHT_CORE_MODEL_POWER_MOMENTS_H_

#include <vector>

#include "core/model/tree.h"

namespace treelight {

/// The point that the moments of a subtree are about: the middle of its box.
inline Vec3 MomentsCenter(const Box& box) {
  return {0.5f * box.min.x + 0.5f * box.max.x, 0.5f * box.min.y + 0.5f * box.max.y,
          0.5f * box.min.z + 0.5f * box.max.z};
}

/// What the offsets of photons from there are divided by, so that moments of no order overflow:
/// the sum of the box's sides.
inline float MomentsUnit(const Box& box) {
  return ((box.max.x - box.min.x) + (box.max.y - box.min.y)) + (box.max.z - box.min.z);
}

/// The moments of the powers below each child of `tree`, in double, on the calling thread.
/// @param powers  [3n] in order of index, W
/// @return [2 * nodes] of the left and the right child of each node
std::vector<PowerMoments> ComputeMoments(const Tree& tree, const std::vector<float>& powers);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_POWER_MOMENTS_H_
