#ifndef TREELIGHT_CORE_CPU_SLIDING_MIDPOINT_H_
#define TREELIGHT_CORE_CPU_SLIDING_MIDPOINT_H_

#include <cstdint>
#include <utility>
#include <vector>

#include "core/cpu/median.h"

namespace treelight {

/// Halves cells (Maneewongvatana and Mount 1999, "It's Okay to Be Skinny, If Your Friends Are
/// Fat"): the plane goes through the middle of the cell's longest side, and where all photons lie
/// on one side of it, it slides to the nearest of them.
///
/// We depart in two points, for photons that lie on planes. Only sides along which the photons
/// differ are halved; a plane that slid to photons of one coordinate cuts off all of these, not one
/// at a time.
class SlidingMidpointSplitter {
 public:
  struct Range : PhotonRange {
    Box cell;
  };

  SlidingMidpointSplitter(const std::vector<float>& positions, std::uint32_t max_leaf_size)
      : order_(positions), max_leaf_size_(max_leaf_size) {}

  /// All photons, in their tight box.
  Range Root(std::uint32_t photon_count) const;

  std::pair<Range, Range> Split(const Range& range);
  void PutLeaf(const Range& range, LeafPhoton* to) { order_.PutSorted(range, to); }

 private:
  PhotonOrder order_;
  const std::uint32_t max_leaf_size_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SLIDING_MIDPOINT_H_
