#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <vector>

#include "core/cpu/treelet_plan.h"
#include "core/cpu/treelet_search.h"

namespace treelight {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kLargestSize = 16;

class KdTreeletSearch : public TreeletSearch {
 public:
  explicit KdTreeletSearch(const TreeletCost& cost) : cost_(cost) {}

  TreeletPlan Find(std::span<const Subtree> leaves) override {
    leaves_ = leaves;
    const std::size_t subset_count = std::size_t{1} << leaves.size();
    if (subsets_.size() < subset_count) subsets_.resize(subset_count);
    ++treelet_;
    SortLeaves();
    const auto all = static_cast<std::uint32_t>(subset_count - 1);
    const float best = Solve(all).cost;
    return PlanOfSubsets(leaves, all, best,
                         [&](std::uint32_t subset) { return subsets_[subset].left; });
  }

 private:
  /// The best tree over a subset of the leaves, a bit for each.
  struct Subset {
    std::uint32_t treelet = 0;  ///< the treelet that this was found for
    std::uint32_t left = 0;     ///< the part left of the cut; 0: there is none
    float cost = 0;
  };

  float Min(std::uint32_t leaf, int axis) const { return Component(leaves_[leaf].box.min, axis); }
  float Max(std::uint32_t leaf, int axis) const { return Component(leaves_[leaf].box.max, axis); }

  void SortLeaves() {
    for (int axis = 0; axis < 3; ++axis) {
      std::uint8_t* order = orders_[axis].data();
      std::iota(order, order + leaves_.size(), std::uint8_t{0});
      std::sort(order, order + leaves_.size(), [&](std::uint8_t a, std::uint8_t b) {
        if (Min(a, axis) != Min(b, axis)) return Min(a, axis) < Min(b, axis);
        if (Max(a, axis) != Max(b, axis)) return Max(a, axis) < Max(b, axis);
        return a < b;
      });
    }
  }

  const Subset& Solve(std::uint32_t subset) {
    Subset& solved = subsets_[subset];
    if (solved.treelet == treelet_) return solved;
    solved = {treelet_, 0, 0};
    if (std::has_single_bit(subset)) {
      solved.cost = leaves_[std::countr_zero(subset)].cost;
      return solved;
    }
    const auto [box, count] = Unite(leaves_, subset);
    float best = kInfinity;
    for (int axis = 0; axis < 3; ++axis) Sweep(subset, axis, Cut::kApart, best, solved.left);
    if (best == kInfinity) {
      for (int axis = 0; axis < 3; ++axis) Sweep(subset, axis, Cut::kTouching, best, solved.left);
    }
    solved.cost = cost_.Node(box, count, best).cost;
    return solved;
  }

  /// What a cut may leave between its parts.
  enum class Cut { kApart, kTouching };

  /// Tries the cuts of the subset on one axis.
  void Sweep(std::uint32_t subset, int axis, Cut cut, float& best, std::uint32_t& best_left) {
    std::uint32_t left = 0;
    float reach = 0;  // largest maximum of `left`
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      const std::uint32_t leaf = orders_[axis][i];
      if ((subset >> leaf & 1) == 0) continue;
      const bool separates =
          cut == Cut::kApart ? reach < Min(leaf, axis) : reach <= Min(leaf, axis);
      if (left != 0 && separates) {
        const float parts = Solve(left).cost + Solve(subset ^ left).cost;
        if (parts < best) {
          best = parts;
          best_left = left;
        }
      }
      reach = left == 0 ? Max(leaf, axis) : std::max(reach, Max(leaf, axis));
      left |= std::uint32_t{1} << leaf;
    }
  }

  const TreeletCost cost_;
  std::span<const Subtree> leaves_;
  std::array<std::array<std::uint8_t, kLargestSize>, 3> orders_;
  std::vector<Subset> subsets_;
  std::uint32_t treelet_ = 0;
};

}  // namespace

std::unique_ptr<TreeletSearch> MakeKdTreeletSearch(const TreeletCost& cost) {
  return std::make_unique<KdTreeletSearch>(cost);
}

}  // namespace treelight
