#ifndef TREELIGHT_CORE_CPU_BOUNDS_H_
#define TREELIGHT_CORE_CPU_BOUNDS_H_

#include <vector>

#include "core/model/box.h"

namespace treelight {

/// The tight box of `positions` [3n], scene units; empty where n is 0. -0 counts as +0.
Box BoundsOf(const std::vector<float>& positions);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_BOUNDS_H_
