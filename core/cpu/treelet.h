#ifndef TREELIGHT_CORE_CPU_TREELET_H_
#define TREELIGHT_CORE_CPU_TREELET_H_

#include <cstdint>

#include "core/cpu/cancellation.h"
#include "core/cpu/loose_tree.h"
#include "core/cpu/treelet_search.h"

namespace treelight {

/// How treelets are put together again.
enum class TreeletMethod { kKdTree, kBvh, kAgglomerative };

struct TreeletOptions {
  TreeletMethod method = TreeletMethod::kKdTree;
  std::uint32_t treelet_size = 7;  ///< leaves of a treelet
  std::uint32_t rounds = 1;
};

/// One round saves at least this part of a treelet's cost, or leaves the treelet as it is: where
/// all costs are the same, rounding shall not choose the tree.
inline constexpr float kTreeletGain = 0x1p-20f;

/// Restructures `tree` (Karras and Aila 2013, with the costs of TreeletCost).
///
/// A round goes bottom-up: a node is the root of a treelet when its subtrees are finished and it
/// has at least as many leaves as a treelet, or is the root of a smaller tree. The treelet grows by
/// the node with the largest measure, in every second round by that with the most photons, the
/// first of equals: its left child takes its place in the list, the right child goes to the end.
/// The new topology replaces the old one where cost < old * (1 - kTreeletGain) and the height is at
/// most kMaxDepth less the depth that the node had when the round began; by induction no tree
/// becomes deeper than kMaxDepth. What happens at a node depends on its subtree alone, so rounds
/// run in parallel and give the same tree in any order.
///
/// We depart from the paper in three points. Growing by turns shows a round other treelets than
/// those that the round before has just finished: a quarter percent. Each round treats all
/// treelets, where theirs doubles the least size from round to round to save time: so three rounds
/// visit half a percent fewer nodes. With the leaf term merging is undone where another topology is
/// cheaper: a merged subtree keeps its nodes, treelets grow into them, and only Arrange makes it a
/// leaf; merging for good gains half as much.
///
/// Asks `cancellation` at each subtree that is worth a task; of a tree whose restructuring was
/// cancelled some subtrees are as they were.
void RestructureTreelets(LooseTree& tree, const TreeletCost& cost, const TreeletOptions& options,
                         const Cancellation& cancellation = kNotCancelled);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_TREELET_H_
