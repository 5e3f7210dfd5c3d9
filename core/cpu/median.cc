#include "core/cpu/median.h"

#include <algorithm>
#include <numeric>

namespace treelight {

PhotonOrder::PhotonOrder(const std::vector<float>& positions)
    : positions_(positions), ids_(positions.size() / 3) {
  std::iota(ids_.begin(), ids_.end(), 0u);
}

Box PhotonOrder::BoxOf(const PhotonRange& range) const {
  Box box;
  for (std::uint32_t i = range.first; i < range.last; ++i) {
    const float* p = &positions_[3 * std::size_t{ids_[i]}];
    box.Extend(Vec3{p[0], p[1], p[2]});
  }
  return box;
}

void PhotonOrder::SelectSmallest(const PhotonRange& range, int axis, std::uint32_t left_count) {
  const auto begin = ids_.begin();
  std::nth_element(begin + range.first, begin + range.first + left_count, begin + range.last,
                   [&](std::uint32_t a, std::uint32_t b) {
                     const float u = Coordinate(a, axis), v = Coordinate(b, axis);
                     return u < v || (u == v && a < b);
                   });
}

void PhotonOrder::PutSorted(const PhotonRange& range, LeafPhoton* to) {
  std::sort(ids_.begin() + range.first, ids_.begin() + range.last);
  PutPhotons(positions_, std::span(ids_).subspan(range.first, range.count()), to);
}

int WidestAxis(const Box& box) {
  const auto extent = [&](int axis) { return Component(box.max, axis) - Component(box.min, axis); };
  int widest = 0;
  for (int axis = 1; axis < 3; ++axis) {
    if (extent(axis) > extent(widest)) widest = axis;
  }
  return widest;
}

std::pair<PhotonRange, PhotonRange> MedianSplitter::Split(const Range& range) {
  const std::uint32_t left_count = leaf_term_ == LeafTerm::kLeafSize
                                       ? WholeLeavesMedian(range.count(), max_leaf_size_)
                                       : (range.count() + 1) / 2;
  order_.SelectSmallest(range, WidestAxis(order_.BoxOf(range)), left_count);
  const std::uint32_t middle = range.first + left_count;
  return {{range.first, middle, range.depth + 1}, {middle, range.last, range.depth + 1}};
}

}  // namespace treelight
