#ifndef TREELIGHT_CORE_CPU_TREELET_PLAN_H_
#define TREELIGHT_CORE_CPU_TREELET_PLAN_H_

#include <bit>
#include <cmath>
#include <span>

#include "core/cpu/treelet_search.h"

namespace treelight {

/// Box and photons of a subset of the leaves, a bit for each.
struct SubsetExtent {
  Box box;
  std::uint32_t count = 0;
};

inline SubsetExtent Unite(std::span<const Subtree> leaves, std::uint32_t subset) {
  SubsetExtent extent;
  for (; subset != 0; subset &= subset - 1) {
    const Subtree& leaf = leaves[static_cast<std::size_t>(std::countr_zero(subset))];
    extent.box.Extend(leaf.box);
    extent.count += leaf.count;
  }
  return extent;
}

/// Appends the joints of `subset` to `plan` and returns its number. `left_of(subset)` is the part
/// of a subset that goes left; 0 where there is none: then its first leaf goes left.
template <typename LeftOf>
std::uint8_t AppendJoints(std::size_t leaf_count, std::uint32_t subset, const LeftOf& left_of,
                          TreeletPlan& plan) {
  if (std::has_single_bit(subset)) return static_cast<std::uint8_t>(std::countr_zero(subset));
  std::uint32_t left = left_of(subset);
  if (left == 0) left = subset & -subset;
  const std::uint8_t left_number = AppendJoints(leaf_count, left, left_of, plan);
  const std::uint8_t right_number = AppendJoints(leaf_count, subset ^ left, left_of, plan);
  plan.joints[plan.joint_count] = {left_number, right_number};
  return static_cast<std::uint8_t>(leaf_count + plan.joint_count++);
}

/// The plan of dynamic programming: how the set `all` of leaves is split.
template <typename LeftOf>
TreeletPlan PlanOfSubsets(std::span<const Subtree> leaves, std::uint32_t all, float cost,
                          const LeftOf& left_of) {
  TreeletPlan plan;
  plan.cost = cost;
  if (!std::isinf(cost)) AppendJoints(leaves.size(), all, left_of, plan);
  return plan;
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_TREELET_PLAN_H_
