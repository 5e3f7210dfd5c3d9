#ifndef TREELIGHT_CORE_MODEL_MORTON_H_
#define TREELIGHT_CORE_MODEL_MORTON_H_

#include <algorithm>
#include <cstdint>

#include "core/model/morton_grid.h"

namespace treelight {

/// Spreads the lowest bits of `v` to every third bit: 21 of 64, 10 of 32.
inline std::uint64_t SpreadBits(std::uint64_t v) {
  v = (v | v << 32) & 0x001f00000000ffff;
  v = (v | v << 16) & 0x001f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  return (v | v << 2) & 0x1249249249249249;
}
inline std::uint32_t SpreadBits(std::uint32_t v) {
  v = (v | v << 16) & 0x030000ff;
  v = (v | v << 8) & 0x0300f00f;
  v = (v | v << 4) & 0x030c30c3;
  return (v | v << 2) & 0x09249249;
}

/// The Morton code of `p`, x highest; what lies outside of the grid has the cell nearest to it,
/// what has none, as far from a grid without extent, the first.
/// @tparam Code  of 64 bits, or where `bits_per_axis` is at most 10, of 32
template <typename Code = std::uint64_t>
Code MortonCode(const Vec3& p, const MortonGrid& grid, unsigned bits_per_axis) {
  const auto last = static_cast<float>((1 << bits_per_axis) - 1);
  Code code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float cell = (Component(p, axis) - grid.min[axis]) * grid.prescale * grid.scale[axis];
    const float inside = std::min(std::max(0.0f, cell), last);  // 0 of what is no number
    code |= SpreadBits(static_cast<Code>(static_cast<std::int32_t>(inside))) << (2 - axis);
  }
  return code;
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_MORTON_H_
