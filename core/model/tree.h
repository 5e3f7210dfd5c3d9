#ifndef TREELIGHT_CORE_MODEL_TREE_H_
#define TREELIGHT_CORE_MODEL_TREE_H_

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "core/kernels/types.h"
#include "core/model/box.h"
#include "core/model/heuristic.h"
#include "core/model/photons.h"

namespace treelight {

/// k-d tree: siblings' boxes are separable by an axis-aligned plane, touching allowed. BVH:
/// siblings may overlap.
enum class TreeKind { kKdTree, kBvh };

/// Binary tree over photons, as builders make it; nodes are described in kernels/types.h.
struct Tree {
  TreeKind kind = TreeKind::kKdTree;
  std::uint32_t max_leaf_size = 16;  ///< B, photons
  Root root{};
  std::vector<Node> nodes;  ///< [leaf_count - 1]; child links index it
  std::vector<std::uint32_t>
      min_ids;  ///< [2 * nodes] smallest photon index below each left, right child
  std::vector<LeafPhoton> photons;  ///< [n] in leaf order
};

/// Proves invariants 1 to 5 for `tree` over `photons`: every photon in exactly one leaf;
/// boxes, counts and smallest indices tight; siblings of a k-d tree separable; leaves of at most B
/// photons; depth at most kMaxDepth. Returns INTERNAL naming the node and the invariant that does
/// not hold.
absl::Status ValidateTree(const Tree& tree, const Photons& photons);

/// A child of a node, and what the node knows of it.
struct TreeChild {
  Box box;                   ///< tight, scene units
  std::uint32_t link = 0;    ///< kLeafBit | first photon, or index of a node
  std::uint32_t count = 0;   ///< photons
  std::uint32_t min_id = 0;  ///< smallest photon index
};

/// The left and the right child of node `link`.
std::array<TreeChild, 2> ChildrenOf(const Tree& tree, std::uint32_t link);

/// The positions [3n] of `photons` in the order of their indices.
std::vector<float> PositionsById(const std::vector<LeafPhoton>& photons);

/// What a tree looks like from outside, whatever builder made it.
struct TreeStatistics {
  std::uint32_t node_count = 0;  ///< inner nodes
  std::uint32_t leaf_count = 0;
  std::uint32_t depth = 0;     ///< edges from the root to the deepest leaf
  double mean_leaf_depth = 0;  ///< edges, over leaves
  double leaf_fill = 0;        ///< photons per leaf, mean
  /// Surface area of all nodes, leaves included, relative to the root's: Bulavintsev and Zhdanov
  /// 2020 with both constants 1. 0 where the root has no area.
  double sah_cost = 0;
  /// The same of the boxes grown by the gather radius on every side: `isa` of the docs. 0 where no
  /// radius is known.
  double isa_cost = 0;
};

/// Measure of all nodes of `tree` by `heuristic`, leaves included, relative to the root's, in
/// double; kSah gives TreeStatistics::sah_cost. 0 where the root's measure is 0.
/// @param radius  gather radius of kIsa and kVvh, scene units
double HeuristicCost(const Tree& tree, Heuristic heuristic, float radius);

/// Computes the statistics of `tree` on the calling thread.
/// @param radius  gather radius of isa_cost, scene units; 0: not known
TreeStatistics ComputeStatistics(const Tree& tree, float radius = 0);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_TREE_H_
