#ifndef TREELIGHT_CORE_MODEL_MORTON_GRID_H_
#define TREELIGHT_CORE_MODEL_MORTON_GRID_H_

#include "core/kernels/types.h"
#include "core/model/box.h"

namespace treelight {

/// The grid of Morton cells over `bounds`: cubic cells, as many along the longest edge as a third
/// of `bits` can number. An edge of length 0, or an empty box, gives a grid whose cells are all
/// number 0.
MortonGrid MakeMortonGrid(const Box& bounds, unsigned bits_per_axis);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_MORTON_GRID_H_
