#ifndef TREELIGHT_CORE_CPU_HYBRID_H_
#define TREELIGHT_CORE_CPU_HYBRID_H_

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/builder.h"
#include "core/cpu/lbvh.h"
#include "core/cpu/sweep.h"
#include "tbb/enumerable_thread_specific.h"

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

  /// @param subtree_size  T, at least `max_leaf_size`
  HybridSplitter(LbvhSplitter& lbvh, const std::vector<float>& positions, const Measure& measure,
                 std::uint32_t max_leaf_size, LeafTerm leaf_term, std::uint32_t subtree_size)
      : lbvh_(lbvh),
        sweeps_([&positions, measure, max_leaf_size, leaf_term] {
          return SweepSplitter(positions, measure, max_leaf_size, leaf_term);
        }),
        subtree_size_(subtree_size) {
    static_assert(kMaxSubtreeSize <= kTaskPhotons, "a subtree is built by one task");
  }

  Range Root() const { return {lbvh_.Root(), false}; }

  std::pair<Range, Range> Split(const Range& range) {
    if (range.count() > subtree_size_) {
      const auto [left, right] = lbvh_.Split(range);
      return {{left, false}, {right, false}};
    }
    PhotonRange swept = range;
    if (!range.swept) {
      Sweep().Begin(range, lbvh_.LeafIds(range));
      swept.depth = SweepDepth(range.cut_level);
    }
    const auto [left, right] = Sweep().Split(swept);
    return {{{left, 0, 0}, true}, {{right, 0, 0}, true}};
  }

  void PutLeaf(const Range& range, LeafPhoton* to) {
    if (!range.swept) Sweep().Begin(range, lbvh_.LeafIds(range));
    Sweep().PutLeaf(range, to);
  }

 private:
  /// The depth that a sweep assumes.
  static std::uint32_t SweepDepth(int cut_level) {
    if (cut_level >= static_cast<int>(kLevelIndex)) return kMaxDepth;
    return std::max(static_cast<std::uint32_t>(cut_level + 1), kMaxDepth - kSweepLevels);
  }

  /// Of the task that builds the subtree, which is one.
  SweepSplitter& Sweep() { return sweeps_.local(); }

  LbvhSplitter& lbvh_;
  tbb::enumerable_thread_specific<SweepSplitter> sweeps_;
  const std::uint32_t subtree_size_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_HYBRID_H_
