#ifndef TREELIGHT_CORE_CPU_HYBRID_H_
#define TREELIGHT_CORE_CPU_HYBRID_H_

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/cpu/lbvh.h"
#include "core/cpu/sweep.h"

namespace treelight {

/// `lbvh` while a subtree has more than T photons, then a sweep: the lbvh with leaves of T photons,
/// each leaf replaced by the tree that a sweep makes of it. The sweep knows of its depth only what
/// the level of the cut above tells, as on the device: levels from positions grow on every path, so
/// there are at most as many nodes above; where photons were cut by place alone, it halves.
class HybridSplitter {
 public:
  struct Range : LbvhSplitter::Range {
    bool swept = false;  ///< sorted for the sweep
  };

  /// @param subtree_size  T, at least the leaf size of `sweep`
  HybridSplitter(LbvhSplitter& lbvh, SweepSplitter& sweep, std::uint32_t subtree_size)
      : lbvh_(lbvh), sweep_(sweep), subtree_size_(subtree_size) {}

  Range Root() const { return {lbvh_.Root(), false}; }

  std::pair<Range, Range> Split(const Range& range) {
    if (range.count() > subtree_size_) {
      const auto [left, right] = lbvh_.Split(range);
      return {{left, false}, {right, false}};
    }
    PhotonRange swept = range;
    if (!range.swept) {
      sweep_.Begin(range, lbvh_.LeafIds(range));
      swept.depth = SweepDepth(range.cut_level);
    }
    const auto [left, right] = sweep_.Split(swept);
    return {{{left, 0, 0}, true}, {{right, 0, 0}, true}};
  }

  std::span<const std::uint32_t> LeafIds(const Range& range) {
    if (!range.swept) sweep_.Begin(range, lbvh_.LeafIds(range));
    return sweep_.LeafIds(range);
  }

 private:
  /// The depth that a sweep assumes.
  static std::uint32_t SweepDepth(int cut_level) {
    if (cut_level >= static_cast<int>(kLevelIndex)) return kMaxDepth;
    return std::max(static_cast<std::uint32_t>(cut_level + 1), kMaxDepth - kSweepLevels);
  }

  LbvhSplitter& lbvh_;
  SweepSplitter& sweep_;
  const std::uint32_t subtree_size_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_HYBRID_H_
