#ifndef TREELIGHT_CORE_CPU_SIMD_LANE_MASKS_H_
#define TREELIGHT_CORE_CPU_SIMD_LANE_MASKS_H_

#include <cstdint>

// Included by one file for each kind of instructions and compiled for it, so all of it has internal
// linkage: what linkers may merge must not hold instructions that another processor lacks.
namespace treelight {
namespace {

std::uint32_t BitCount(std::uint32_t mask) {
  return static_cast<std::uint32_t>(__builtin_popcount(mask));
}

/// Calls `work(i)` for each bit i of `mask`, lowest first.
template <typename Work>
void ForEachBit(std::uint32_t mask, const Work& work) {
  for (; mask != 0; mask &= mask - 1) work(static_cast<std::uint32_t>(__builtin_ctz(mask)));
}

/// The lanes below `count`.
template <typename L>
typename L::Mask FirstLanes(std::uint32_t count) {
  return count >= L::kWidth ? (1u << L::kWidth) - 1 : (1u << count) - 1;
}

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_LANE_MASKS_H_
