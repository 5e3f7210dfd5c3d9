#ifndef TREELIGHT_CORE_CPU_HYBRID_H_
#define TREELIGHT_CORE_CPU_HYBRID_H_

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include "core/builder.h"
#include "core/cpu/lbvh.h"
#include "core/cpu/sweep.h"
#include "tbb/enumerable_thread_specific.h"

namespace treelight {

/// `lbvh` while a subtree has more than T photons, then a sweep: each leaf of an lbvh with leaves
/// of T photons is replaced by the tree that a sweep makes of it. The sweep knows of its depth only
/// what the level of the cut above tells, as on the device: levels from positions grow on every
/// path, so there are at most as many nodes above; where photons were cut by place alone, it
/// halves.
class HybridSplitter {
 public:
  struct Range : PhotonRange {
    const Subtree* upper;  ///< of the lbvh; null below its leaves
    std::uint32_t levels;  ///< of cuts from the root down to here, at most
  };

  /// @param lbvh   has made `upper`, and stays as long as this
  /// @param upper  leaves of at most T photons, and stays as long as this
  HybridSplitter(const LbvhSplitter& lbvh, const LooseTree& upper, const Measure& measure,
                 std::uint32_t max_leaf_size, LeafTerm leaf_term)
      : lbvh_(lbvh), upper_(upper), sweeps_([measure, max_leaf_size, leaf_term] {
          return SweepSplitter(measure, max_leaf_size, leaf_term);
        }) {
    static_assert(kMaxSubtreeSize <= kTaskPhotons, "a subtree is built by one task");
  }

  Range Root() const { return {{0, upper_.root.count, 0}, &upper_.root, 0}; }

  std::pair<Range, Range> Split(const Range& range) {
    if (range.upper != nullptr && !range.upper->is_leaf()) return Descend(range);
    PhotonRange swept = range;
    if (range.upper != nullptr) {
      Begin(range);
      swept.depth = SweepDepth(range.levels);
    }
    const auto [left, right] = Sweep().Split(swept);
    return {{left, nullptr, 0}, {right, nullptr, 0}};
  }

  void PutLeaf(const Range& range, LeafPhoton* to) {
    if (range.upper != nullptr) Begin(range);
    Sweep().PutLeaf(range, to);
  }

 private:
  std::pair<Range, Range> Descend(const Range& range) const {
    const auto& [left, right] = upper_.nodes[range.upper->link];
    const std::uint32_t place = range.first + left.count;
    const std::uint32_t levels = lbvh_.CutLevel(place) + 1;
    return {{{range.first, place, range.depth + 1}, &left, levels},
            {{place, range.last, range.depth + 1}, &right, levels}};
  }

  /// The depth that a sweep assumes.
  static std::uint32_t SweepDepth(std::uint32_t levels) {
    if (levels > kLevelIndex) return kMaxDepth;
    return std::max(levels, kMaxDepth - kSweepLevels);
  }

  void Begin(const Range& range) {
    Sweep().Begin(range, std::span(upper_.photons).subspan(range.first, range.count()));
  }

  /// Of the task that builds the subtree, which is one.
  SweepSplitter& Sweep() { return sweeps_.local(); }

  const LbvhSplitter& lbvh_;
  const LooseTree& upper_;
  tbb::enumerable_thread_specific<SweepSplitter> sweeps_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_HYBRID_H_
