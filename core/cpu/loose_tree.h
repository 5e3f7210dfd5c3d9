#ifndef TREELIGHT_CORE_CPU_LOOSE_TREE_H_
#define TREELIGHT_CORE_CPU_LOOSE_TREE_H_

#include <array>
#include <cstdint>
#include <span>

#include "core/cpu/raw_vector.h"
#include "core/model/tree.h"

namespace treelight {

/// What the node above knows of a subtree.
struct Subtree {
  Box box;                       ///< tight, scene units
  std::uint32_t link = 0;        ///< kLeafBit | first photon, or index of a node
  std::uint32_t count = 0;       ///< photons
  std::uint32_t min_id = 0;      ///< smallest photon index
  std::uint32_t leaf_count = 1;  ///< links with kLeafBit below
  std::uint32_t height = 0;      ///< edges down to the deepest of them
  float cost = 0;                ///< of a restructured subtree, see treelet_search.h
  bool merged = false;           ///< all photons below become one leaf, although `link` is a node

  bool is_leaf() const { return (link & kLeafBit) != 0; }
};

/// A tree while it is built: nodes at any index, leaves in any order, unused nodes between. The
/// layout of Tree, where node i separates leaf i from leaf i + 1, is made once, at the end.
struct LooseTree {
  RawVector<std::array<Subtree, 2>> nodes;  ///< left and right child of each
  Subtree root;                             ///< undefined where there are no photons
  RawVector<LeafPhoton> photons;            ///< [n] each leaf's in one piece
};

/// The leaf over photons [first, last) of `photons`.
Subtree MakeLeaf(std::span<const LeafPhoton> photons, std::uint32_t first, std::uint32_t last);

/// The subtree of node `link` with these children; its cost is 0 and it is not merged.
Subtree Join(std::uint32_t link, const Subtree& left, const Subtree& right);

/// `tree` again, to be rebuilt.
LooseTree Loosen(const Tree& tree);

/// Puts nodes, leaves and photons in order: one walk from left to right.
Tree Arrange(const LooseTree& loose, TreeKind kind, std::uint32_t max_leaf_size);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_LOOSE_TREE_H_
