#include "core/cpu/sweep.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "core/cpu/median.h"
#include "core/cpu/radix_sort.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

float Coordinate(const LeafPhoton& photon, int axis) {
  return axis == 0 ? photon.x : axis == 1 ? photon.y : photon.z;
}

/// A number that orders as `value` does, which is not -0.
std::uint32_t OrderedBits(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}

/// Calls `work` for each axis, in parallel where that pays.
template <typename Work>
void ForEachAxis(std::uint32_t count, const Work& work) {
  if (count > kTaskPhotons) {
    tbb::parallel_for(0, 3, work);
  } else {
    for (int axis = 0; axis < 3; ++axis) work(axis);
  }
}

}  // namespace

SweepSplitter::SweepSplitter(const Measure& measure, std::uint32_t max_leaf_size,
                             LeafTerm leaf_term, const Cancellation& cancellation)
    : measure_(measure),
      max_leaf_size_(max_leaf_size),
      leaf_term_(leaf_term),
      cancellation_(cancellation) {}

void SweepSplitter::Begin(const Range& range, std::span<const LeafPhoton> photons) {
  first_ = range.first;
  photons_.assign(photons.begin(), photons.end());
  goes_right_.resize(photons.size());
  MakeUnits(range.count());
  ForEachAxis(range.count(), [&](int axis) { SortAxis(axis); });
}

void SweepSplitter::MakeUnits(std::uint32_t count) {
  for (auto n = static_cast<std::uint32_t>(units_.size()); n <= count; ++n) {
    units_.push_back(static_cast<float>(
        leaf_term_ == LeafTerm::kLeafSize ? FullLeafCount(n, max_leaf_size_) : n));
  }
}

void SweepSplitter::SortAxis(int axis) {
  const auto n = static_cast<std::uint32_t>(photons_.size());
  orders_[axis].resize(n);
  left_costs_[axis].resize(n);
  spare_[axis].resize(n);
  constexpr std::uint32_t kFewPhotons = 32;
  RawVector<std::uint64_t> places(n), other;  // coordinate, then place
  std::uint32_t least = std::numeric_limits<std::uint32_t>::max(), most = 0;
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t coordinate = OrderedBits(Coordinate(photons_[i], axis));
    least = std::min(least, coordinate);
    most = std::max(most, coordinate);
    places[i] = std::uint64_t{coordinate} << 32 | i;
  }
  if (n > kFewPhotons) {
    RadixSort(
        places, other, static_cast<unsigned>(std::bit_width(most - least)),
        [least](std::uint64_t place) { return static_cast<std::uint32_t>(place >> 32) - least; },
        cancellation_);
  } else {
    std::sort(places.begin(), places.end());
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const auto place = static_cast<std::uint32_t>(places[i]);
    orders_[axis][i] = photons_[place];
    orders_[axis][i].id = place;
  }
}

SweepSplitter::Cut SweepSplitter::SweepAxis(const Range& range, int axis) {
  const LeafPhoton* const photons = &orders_[axis][range.first - first_];
  float* const left_costs = &left_costs_[axis][range.first - first_];
  const std::uint32_t n = range.count();
  const Measure4 measure = measure_;
  const float* const units = units_.data();
  Box4 left, right;
  for (std::uint32_t i = 1; i < n; ++i) {
    left.Extend(PositionOf(photons[i - 1]));
    left_costs[i] = measure(left) * units[i];
  }
  const float extent = Coordinate(photons[n - 1], axis) - Coordinate(photons[0], axis);
  Cut best{std::numeric_limits<float>::infinity(), n, extent, axis, 0};
  for (std::uint32_t i = n - 1; i > 0; --i) {
    right.Extend(PositionOf(photons[i]));
    const float cost = left_costs[i] + measure(right) * units[n - i];
    if (cost > best.cost) continue;
    const std::uint32_t imbalance = 2 * i > n ? 2 * i - n : n - 2 * i;
    const Cut cut{cost, imbalance, extent, axis, i};
    if (!(best < cut)) best = cut;  // places descend: of equals the lower one stays
  }
  return best;
}

SweepSplitter::Cut SweepSplitter::FindCut(const Range& range) {
  if (MustHalve(range, max_leaf_size_)) {
    Box box;
    for (std::uint32_t i = 0; i < range.count(); ++i) {
      const LeafPhoton& photon = orders_[0][range.first - first_ + i];
      box.Extend(Vec3{photon.x, photon.y, photon.z});
    }
    return {0, 0, 0, WidestAxis(box), WholeLeavesMedian(range.count(), max_leaf_size_)};
  }
  std::array<Cut, 3> cuts;
  ForEachAxis(range.count(), [&](int axis) { cuts[axis] = SweepAxis(range, axis); });
  return *std::min_element(cuts.begin(), cuts.end());
}

void SweepSplitter::Partition(const Range& range, const Cut& cut) {
  const LeafPhoton* const cut_order = &orders_[cut.axis][range.first - first_];
  for (std::uint32_t i = 0; i < range.count(); ++i) {
    goes_right_[cut_order[i].id] = i >= cut.left_count ? 1 : 0;
  }
  // The other two orders stay sorted on each side.
  ForEachAxis(range.count(), [&](int axis) {
    if (axis == cut.axis) return;
    LeafPhoton* left = &orders_[axis][range.first - first_];
    LeafPhoton* const spare = &spare_[axis][range.first - first_];
    LeafPhoton* right = spare;
    const LeafPhoton* const last = left + range.count();
    for (const LeafPhoton* photon = left; photon < last; ++photon) {
      // Which side is chance: written to both, kept on one.
      const LeafPhoton moved = *photon;
      const std::uint32_t goes_right = goes_right_[moved.id];
      *left = moved;
      *right = moved;
      right += goes_right;
      left += 1 - goes_right;
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

void SweepSplitter::PutLeaf(const Range& range, LeafPhoton* to) const {
  const LeafPhoton* const ordered = &orders_[0][range.first - first_];
  for (std::uint32_t i = 0; i < range.count(); ++i) to[i] = photons_[ordered[i].id];
}

}  // namespace treelight
