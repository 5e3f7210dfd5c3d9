#ifndef TREELIGHT_CORE_CPU_LBVH_H_
#define TREELIGHT_CORE_CPU_LBVH_H_

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/builder.h"
#include "core/cpu/top_down.h"

namespace treelight {

/// How Morton cells lie over the box of all photons, and what happens to photons of one cell.
enum class MortonLayout {
  kCubic,    ///< cubic cells; runs of equal codes longer than a leaf are rebuilt by position
  kPerAxis,  ///< as many cells along each axis, runs of equal codes split by place: Karras 2012 as
             ///< he has it. Siblings within such a run overlap: the tree is a BVH.
};

/// The tree of the radix sort of Morton codes (Karras 2012), top-down: a subtree is cut where the
/// highest bit changes in which its codes differ. kCubic gives the device's `lbvh` bit by bit.
class LbvhSplitter {
 public:
  struct Range : PhotonRange {
    std::uint32_t level = 0;  ///< next free level, see BreakTies of core/gpu/ties.h
  };

  LbvhSplitter(const std::vector<float>& positions, MortonBits bits, MortonLayout layout,
               std::uint32_t max_leaf_size, const Cancellation& cancellation = kNotCancelled);

  Range Root() const;

  std::pair<Range, Range> Split(const Range& range);
  std::span<const std::uint32_t> LeafIds(const PhotonRange& range) const {
    return std::span(ids_).subspan(range.first, range.count());
  }
  /// The level of the cut whose right side begins at `place`; kLevelIndex and up: by place.
  std::uint32_t CutLevel(std::uint32_t place) const { return cut_levels_[place]; }
  void PutLeaf(const PhotonRange& range, LeafPhoton* to) const {
    PutPhotons(positions_, LeafIds(range), to);
  }

 private:
  Vec3 PositionOf(std::uint32_t id) const;
  void SortByCodes(const PhotonRange& range, const MortonGrid& grid, unsigned bits_per_axis);
  template <typename Code>
  void SortBy(const PhotonRange& range, const MortonGrid& grid, unsigned bits_per_axis);
  struct Cut {
    std::uint32_t place;  ///< the first on the right
    std::uint32_t level;  ///< kLevelIndex and up: by place
  };
  static Cut CutByPlace(const PhotonRange& range);
  Cut FindCodeCut(const Range& range) const;
  Cut CutTies(Range& range);

  const std::vector<float>& positions_;
  const MortonLayout layout_;
  const std::uint32_t max_leaf_size_;
  const std::uint32_t code_bits_;
  const Cancellation& cancellation_;
  RawVector<std::uint32_t> ids_;        ///< [n] photon at each place
  RawVector<std::uint64_t> codes_;      ///< [n] code at each place, in the grid of its run
  RawVector<std::uint8_t> cut_levels_;  ///< [n] of the cut before each place, where there is one
};

/// The whole tree; of one that was cancelled parts, as TopDown leaves them.
LooseTree BuildLbvh(const std::vector<float>& positions, MortonBits bits, MortonLayout layout,
                    std::uint32_t max_leaf_size, const Cancellation& cancellation = kNotCancelled);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_LBVH_H_
