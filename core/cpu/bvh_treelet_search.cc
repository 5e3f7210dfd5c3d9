#include <limits>
#include <vector>

#include "core/cpu/treelet_plan.h"
#include "core/cpu/treelet_search.h"

namespace treelight {
namespace {

class BvhTreeletSearch : public TreeletSearch {
 public:
  explicit BvhTreeletSearch(const TreeletCost& cost) : cost_(cost) {}

  TreeletPlan Find(std::span<const Subtree> leaves) override {
    const std::uint32_t all = (std::uint32_t{1} << leaves.size()) - 1;
    lefts_.resize(all + std::size_t{1});
    costs_.resize(all + std::size_t{1});
    // The parts of a subset are smaller numbers than it.
    for (std::uint32_t subset = 1; subset <= all; ++subset) {
      if (std::has_single_bit(subset)) {
        costs_[subset] = leaves[static_cast<std::size_t>(std::countr_zero(subset))].cost;
      } else {
        Solve(subset, Unite(leaves, subset));
      }
    }
    return PlanOfSubsets(leaves, all, costs_[all],
                         [&](std::uint32_t subset) { return lefts_[subset]; });
  }

 private:
  void Solve(std::uint32_t subset, const SubsetExtent& extent) {
    // All partitions once: `right` goes through the parts without the lowest leaf of the subset.
    float best = std::numeric_limits<float>::infinity();
    const std::uint32_t delta = (subset - 1) & subset;
    for (std::uint32_t right = -delta & subset; right != 0; right = (right - delta) & subset) {
      const float parts = costs_[subset ^ right] + costs_[right];
      if (parts < best) {
        best = parts;
        lefts_[subset] = subset ^ right;
      }
    }
    costs_[subset] = cost_.Node(extent.box, extent.count, best).cost;
  }

  const TreeletCost cost_;
  std::vector<std::uint32_t> lefts_;  ///< [2^n] part of each subset that goes left
  std::vector<float> costs_;          ///< [2^n]
};

}  // namespace

std::unique_ptr<TreeletSearch> MakeBvhTreeletSearch(const TreeletCost& cost) {
  return std::make_unique<BvhTreeletSearch>(cost);
}

}  // namespace treelight
