#ifndef TREELIGHT_CORE_MODEL_SPLIT_MIX_H_
#define TREELIGHT_CORE_MODEL_SPLIT_MIX_H_

#include <cstdint>

namespace treelight {

/// The number `index` of the random sequence SplitMix64 of seed 0 (Steele, Lea and Flood 2014,
/// "Fast Splittable Pseudorandom Number Generators"): a hash of `index`.
inline std::uint64_t SplitMix(std::uint64_t index) {
  std::uint64_t bits = (index + 1) * 0x9e3779b97f4a7c15u;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
  return bits ^ (bits >> 31);
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_SPLIT_MIX_H_
