#include "core/cpu/sliding_midpoint.h"

#include <cmath>

namespace treelight {
namespace {

void SetComponent(Vec3& v, int axis, float value) {
  (axis == 0 ? v.x : axis == 1 ? v.y : v.z) = value;
}

/// The longest side of the cell among those along which the photons differ; -1 where they are at
/// one position.
int AxisToHalve(const Box& cell, const Box& tight) {
  int best = -1;
  for (int axis = 0; axis < 3; ++axis) {
    if (Component(tight.min, axis) == Component(tight.max, axis)) continue;
    const auto length = [&](int a) { return Component(cell.max, a) - Component(cell.min, a); };
    if (best < 0 || length(axis) > length(best)) best = axis;
  }
  return best;
}

}  // namespace

SlidingMidpointSplitter::Range SlidingMidpointSplitter::Root(std::uint32_t photon_count) const {
  const PhotonRange all{0, photon_count, 0};
  return {all, order_.BoxOf(all)};
}

std::pair<SlidingMidpointSplitter::Range, SlidingMidpointSplitter::Range>
SlidingMidpointSplitter::Split(const Range& range) {
  const Box tight = order_.BoxOf(range);
  const int axis = AxisToHalve(range.cell, tight);
  std::pair<Range, Range> parts{range, range};
  if (axis < 0 || MustHalve(range, max_leaf_size_)) {
    // Not a cut of the cell: both sides keep all of it.
    const std::uint32_t left_count = WholeLeavesMedian(range.count(), max_leaf_size_);
    order_.SelectSmallest(range, WidestAxis(tight), left_count);
    parts.first.last = range.first + left_count;
  } else {
    const float low = Component(tight.min, axis), high = Component(tight.max, axis);
    float plane = Component(range.cell.min, axis) +
                  0.5f * (Component(range.cell.max, axis) - Component(range.cell.min, axis));
    if (plane > high) plane = high;                       // slides down: the highest go right
    if (plane <= low) plane = std::nextafter(low, high);  // slides up: the lowest go left
    parts.first.last = range.first + order_.PartitionBelow(range, axis, plane);
    SetComponent(parts.first.cell.max, axis, plane);
    SetComponent(parts.second.cell.min, axis, plane);
  }
  parts.second.first = parts.first.last;
  parts.first.depth = parts.second.depth = range.depth + 1;
  return parts;
}

}  // namespace treelight
