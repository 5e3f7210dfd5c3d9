#include "core/cpu/sweep.h"

#include <algorithm>
#include <limits>

#include "core/cpu/median.h"
#include "tbb/parallel_for.h"
#include "tbb/parallel_sort.h"

namespace treelight {
namespace {

float Coordinate(const LeafPhoton& photon, int axis) {
  return axis == 0 ? photon.x : axis == 1 ? photon.y : photon.z;
}

Vec3 PositionOf(const LeafPhoton& photon) { return {photon.x, photon.y, photon.z}; }

/// Calls `work` for each axis, in parallel where that pays.
template <typename Work>
void ForEachAxis(const PhotonRange& range, const Work& work) {
  if (range.count() > kTaskPhotons) {
    tbb::parallel_for(0, 3, work);
  } else {
    for (int axis = 0; axis < 3; ++axis) work(axis);
  }
}

}  // namespace

SweepSplitter::SweepSplitter(const std::vector<float>& positions, const Measure& measure,
                             std::uint32_t max_leaf_size, LeafTerm leaf_term)
    : measure_(measure),
      max_leaf_size_(max_leaf_size),
      leaf_term_(leaf_term),
      positions_(positions) {
  const std::size_t n = positions.size() / 3;
  for (int axis = 0; axis < 3; ++axis) {
    orders_[axis].resize(n);
    left_costs_[axis].resize(n);
    spare_[axis].resize(n);
  }
  goes_right_.resize(n);
  leaf_ids_.resize(n);
}

void SweepSplitter::Begin(const Range& range, std::span<const std::uint32_t> ids) {
  ForEachAxis(range, [&](int axis) {
    std::vector<std::pair<float, std::uint32_t>> places(ids.size());  // coordinate, place in `ids`
    for (std::uint32_t i = 0; i < ids.size(); ++i) {
      places[i] = {positions_[3 * std::size_t{ids[i]} + axis] + 0.0f, i};
    }
    tbb::parallel_sort(places.begin(), places.end());
    LeafPhoton* photons = orders_[axis].data() + range.first;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const std::uint32_t id = ids[places[i].second];
      const float* p = &positions_[3 * std::size_t{id}];
      photons[i] = {p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f, id};
    }
  });
}

float SweepSplitter::LeafUnits(std::uint32_t count) const {
  return static_cast<float>(leaf_term_ == LeafTerm::kLeafSize ? FullLeafCount(count, max_leaf_size_)
                                                              : count);
}

SweepSplitter::Cut SweepSplitter::SweepAxis(const Range& range, int axis) {
  const LeafPhoton* photons = orders_[axis].data() + range.first;
  float* left_costs = left_costs_[axis].data() + range.first;
  const std::uint32_t n = range.count();
  Box left, right;
  for (std::uint32_t i = 1; i < n; ++i) {
    left.Extend(PositionOf(photons[i - 1]));
    left_costs[i] = measure_(left) * LeafUnits(i);
  }
  const float extent = Coordinate(photons[n - 1], axis) - Coordinate(photons[0], axis);
  Cut best{std::numeric_limits<float>::infinity(), n, extent, axis, 0};
  for (std::uint32_t i = n - 1; i > 0; --i) {
    right.Extend(PositionOf(photons[i]));
    const float cost = left_costs[i] + measure_(right) * LeafUnits(n - i);
    const std::uint32_t imbalance = 2 * i > n ? 2 * i - n : n - 2 * i;
    const Cut cut{cost, imbalance, extent, axis, i};
    if (!(best < cut)) best = cut;  // places descend: of equals the lower one stays
  }
  return best;
}

SweepSplitter::Cut SweepSplitter::FindCut(const Range& range) {
  if (MustHalve(range, max_leaf_size_)) {
    Box box;
    for (std::uint32_t i = range.first; i < range.last; ++i) box.Extend(PositionOf(orders_[0][i]));
    return {0, 0, 0, WidestAxis(box), WholeLeavesMedian(range.count(), max_leaf_size_)};
  }
  std::array<Cut, 3> cuts;
  ForEachAxis(range, [&](int axis) { cuts[axis] = SweepAxis(range, axis); });
  return *std::min_element(cuts.begin(), cuts.end());
}

void SweepSplitter::Partition(const Range& range, const Cut& cut) {
  const LeafPhoton* cut_order = orders_[cut.axis].data() + range.first;
  for (std::uint32_t i = 0; i < range.count(); ++i) {
    goes_right_[cut_order[i].id] = i >= cut.left_count ? 1 : 0;
  }
  // The other two orders stay sorted on each side.
  ForEachAxis(range, [&](int axis) {
    if (axis == cut.axis) return;
    LeafPhoton* left = orders_[axis].data() + range.first;
    LeafPhoton* const spare = spare_[axis].data() + range.first;
    LeafPhoton* right = spare;
    const LeafPhoton* const last = orders_[axis].data() + range.last;
    for (const LeafPhoton* photon = left; photon < last; ++photon) {
      *(goes_right_[photon->id] != 0 ? right++ : left++) = *photon;
    }
    std::copy(spare, right, left);
  });
}

std::pair<PhotonRange, PhotonRange> SweepSplitter::Split(const Range& range) {
  const Cut cut = FindCut(range);
  Partition(range, cut);
  const std::uint32_t middle = range.first + cut.left_count;
  return {{range.first, middle, range.depth + 1}, {middle, range.last, range.depth + 1}};
}

std::span<const std::uint32_t> SweepSplitter::LeafIds(const Range& range) {
  const auto ids = std::span(leaf_ids_).subspan(range.first, range.count());
  for (std::uint32_t i = 0; i < ids.size(); ++i) ids[i] = orders_[0][range.first + i].id;
  return ids;
}

}  // namespace treelight
