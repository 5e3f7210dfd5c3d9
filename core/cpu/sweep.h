#ifndef TREELIGHT_CORE_CPU_SWEEP_H_
#define TREELIGHT_CORE_CPU_SWEEP_H_

#include <array>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/cpu/float4.h"
#include "core/cpu/raw_vector.h"
#include "core/cpu/top_down.h"
#include "core/model/heuristic.h"

namespace treelight {

/// Takes the cut of least cost among all cuts between neighbours on the three axes (the sweep of
/// MacDonald and Booth 1990 over tight boxes, as Wald 2007 has it for BVHs):
///   cost = M(left) * T(left count) + M(right) * T(right count)
/// M is the heuristic's measure; T(n) = n, or ceil(n / B) with kLeafSize. In float32, the two
/// products rounded, then their sum. Photons are swept in the order of the coordinate, of equal
/// ones in the order given to Begin. Of equal costs the cut nearest the middle wins, then the axis
/// on which the tight box is longer, then the lower axis, then the lower place. Photons of a leaf
/// lie in the order of the first axis. (By sah all cuts of a line cost 0, also those on an axis on
/// which its photons are equal.)
class SweepSplitter {
 public:
  using Range = PhotonRange;

  SweepSplitter(const Measure& measure, std::uint32_t max_leaf_size, LeafTerm leaf_term,
                const Cancellation& cancellation = kNotCancelled);

  /// Lets `photons` be those of the range and sorts them on each axis. Before the first Split; what
  /// was begun before is forgotten.
  void Begin(const Range& range, std::span<const LeafPhoton> photons);

  std::pair<Range, Range> Split(const Range& range);
  void PutLeaf(const Range& range, LeafPhoton* to) const;

 private:
  struct Cut {
    float cost;
    std::uint32_t imbalance;  ///< |left count - right count|
    float extent;             ///< of the tight box on the axis
    int axis;
    std::uint32_t left_count;
    friend bool operator<(const Cut& a, const Cut& b) {
      return std::tuple(a.cost, a.imbalance, -a.extent) <
             std::tuple(b.cost, b.imbalance, -b.extent);
    }
  };

  void SortAxis(int axis);
  void MakeUnits(std::uint32_t count);
  Cut SweepAxis(const Range& range, int axis);
  Cut FindCut(const Range& range);
  void Partition(const Range& range, const Cut& cut);

  const Measure4 measure_;
  const std::uint32_t max_leaf_size_;
  const LeafTerm leaf_term_;
  const Cancellation& cancellation_;
  std::vector<float> units_;  ///< T(n)
  std::uint32_t first_ = 0;   ///< place where the range that was begun begins
  /// Its n photons. In all that follows their numbers are places in this array.
  RawVector<LeafPhoton> photons_;
  std::array<RawVector<LeafPhoton>, 3> orders_;  ///< [n] each range sorted on that axis
  std::array<RawVector<float>, 3> left_costs_;   ///< [n] of the sweep from the left
  std::array<RawVector<LeafPhoton>, 3> spare_;   ///< [n] right parts while a range is cut
  RawVector<std::uint8_t> goes_right_;           ///< [n] of the last cut
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SWEEP_H_
