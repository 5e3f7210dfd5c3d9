#ifndef TREELIGHT_CORE_CPU_MEDIAN_H_
#define TREELIGHT_CORE_CPU_MEDIAN_H_

#include <cstdint>
#include <vector>

#include "core/cpu/top_down.h"
#include "core/model/heuristic.h"

namespace treelight {

/// Photons in an order that splitters change: place i of the leaf order holds photon ids[i].
/// Comparisons are by (coordinate, photon index), which leaves no ties.
class PhotonOrder {
 public:
  /// The order of indices.
  explicit PhotonOrder(const std::vector<float>& positions);

  Box BoxOf(const PhotonRange& range) const;

  /// Moves the `left_count` smallest photons on `axis` to the front of the range.
  void SelectSmallest(const PhotonRange& range, int axis, std::uint32_t left_count);

  /// Writes the photons of a leaf, by index.
  void PutSorted(const PhotonRange& range, LeafPhoton* to);

 private:
  float Coordinate(std::uint32_t id, int axis) const {
    return positions_[3 * std::size_t{id} + axis];
  }

  const std::vector<float>& positions_;
  std::vector<std::uint32_t> ids_;
};

/// The axis on which the box is longest, the first of several.
int WidestAxis(const Box& box);

/// Splits at the median of the widest axis of the tight box (Bentley 1975, with the axis of
/// Friedman, Bentley and Finkel 1977); with kLeafSize, at the multiple of B next above the median,
/// so that all leaves but one are full.
class MedianSplitter {
 public:
  using Range = PhotonRange;

  MedianSplitter(const std::vector<float>& positions, std::uint32_t max_leaf_size,
                 LeafTerm leaf_term)
      : order_(positions), max_leaf_size_(max_leaf_size), leaf_term_(leaf_term) {}

  std::pair<Range, Range> Split(const Range& range);
  void PutLeaf(const Range& range, LeafPhoton* to) { order_.PutSorted(range, to); }

 private:
  PhotonOrder order_;
  const std::uint32_t max_leaf_size_;
  const LeafTerm leaf_term_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_MEDIAN_H_
