#include "core/model/morton_grid.h"

#include <algorithm>
#include <cmath>

namespace treelight {

MortonGrid MakeMortonGrid(const Box& bounds, unsigned bits_per_axis) {
  const float longest = std::max({bounds.max.x - bounds.min.x, bounds.max.y - bounds.min.y,
                                  bounds.max.z - bounds.min.z, 0.0f});
  MortonGrid grid{};
  grid.prescale = longest < 0x1p-60f ? 0x1p96f : 1.0f;
  const float cells = std::exp2(static_cast<float>(bits_per_axis));
  const float scale = longest > 0 ? cells / (longest * grid.prescale) : 0.0f;
  for (int axis = 0; axis < 3; ++axis) {
    grid.min[axis] = longest > 0 ? Component(bounds.min, axis) : 0.0f;
    grid.scale[axis] = scale;
  }
  return grid;
}

}  // namespace treelight
