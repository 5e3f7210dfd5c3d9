#ifndef TREELIGHT_CORE_CPU_HYBRID_H_
#define TREELIGHT_CORE_CPU_HYBRID_H_

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/cpu/lbvh.h"
#include "core/cpu/sweep.h"

namespace treelight {

/// `lbvh` while a subtree has more than T photons, then a sweep: the lbvh with leaves of T photons,
/// each leaf replaced by the tree that a sweep makes of it.
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
    if (!range.swept) sweep_.Begin(range, lbvh_.LeafIds(range));
    const auto [left, right] = sweep_.Split(range);
    return {{{left, 0}, true}, {{right, 0}, true}};
  }

  std::span<const std::uint32_t> LeafIds(const Range& range) {
    if (!range.swept) sweep_.Begin(range, lbvh_.LeafIds(range));
    return sweep_.LeafIds(range);
  }

 private:
  LbvhSplitter& lbvh_;
  SweepSplitter& sweep_;
  const std::uint32_t subtree_size_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_HYBRID_H_
