#ifndef TREELIGHT_CORE_MODEL_MORTON_H_
#define TREELIGHT_CORE_MODEL_MORTON_H_

#include <cstdint>

#include "core/model/morton_grid.h"

namespace treelight {

/// Spreads the lowest 21 bits of `v` to every third bit.
inline std::uint64_t SpreadBits(std::uint64_t v) {
  v = (v | v << 32) & 0x001f00000000ffff;
  v = (v | v << 16) & 0x001f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  return (v | v << 2) & 0x1249249249249249;
}

/// The Morton code of `p`, x highest; what lies outside of the grid has the cell nearest to it,
/// what has none, as far from a grid without extent, the first.
inline std::uint64_t MortonCode(const Vec3& p, const MortonGrid& grid, unsigned bits_per_axis) {
  const std::uint64_t last = (std::uint64_t{1} << bits_per_axis) - 1;
  std::uint64_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float cell = (Component(p, axis) - grid.min[axis]) * grid.prescale * grid.scale[axis];
    const std::uint64_t number =
        cell >= static_cast<float>(last) ? last : static_cast<std::uint64_t>(cell > 0 ? cell : 0);
    code |= SpreadBits(number) << (2 - axis);
  }
  return code;
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_MORTON_H_
