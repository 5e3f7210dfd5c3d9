#ifndef TREELIGHT_CORE_CPU_TREELET_SEARCH_H_
#define TREELIGHT_CORE_CPU_TREELET_SEARCH_H_

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "core/cpu/loose_tree.h"
#include "core/model/heuristic.h"

namespace treelight {

/// What a tree costs, relative to a visit of a node with the measure 1:
///   inner node:  M(box) + (cost(left) + cost(right))
///   leaf:        M(box) * (1 + 0.2 n)
/// in float32, each operation rounded. With the leaf term a subtree of at most B photons costs the
/// smaller of the two, and becomes a leaf in the end where that is the second, or both are equal.
/// Of interest is only what a treelet can change: without the leaf term leaves stay, and with it
/// no treelet merges leaves below a subtree of more than B photons; these cost nothing.
struct TreeletCost {
  Measure measure;
  LeafTerm leaf_term;
  std::uint32_t max_leaf_size;  ///< B

  /// A node or part of a treelet whose children cost `parts` together. +inf parts: there are none.
  struct Choice {
    float cost;
    bool merged;  ///< one leaf
  };
  Choice Node(const Box& box, std::uint32_t count, float parts) const {
    const float inner = measure(box) + parts;
    if (!MayMerge(count)) return {inner, false};
    const float leaf = Leaf(box, count);
    return leaf <= inner ? Choice{leaf, true} : Choice{inner, false};
  }

  /// A leaf of the tree.
  float Leaf(const Box& box, std::uint32_t count) const {
    return measure(box) * (1.0f + 0.2f * static_cast<float>(count));
  }

  /// Whether treelets above may merge a subtree with others, so that its cost counts.
  bool MayMerge(std::uint32_t count) const {
    return leaf_term == LeafTerm::kLeafSize && count <= max_leaf_size;
  }
};

/// Leaves of a treelet, at most.
inline constexpr std::uint32_t kMaxTreeletSize = 32;

/// How the n leaves of a treelet are put together: n - 1 joints, children before their parents.
struct TreeletPlan {
  struct Joint {
    std::uint8_t left, right;  ///< below n: that leaf; else n + j: joint j
  };
  std::array<Joint, kMaxTreeletSize - 1> joints;
  std::uint32_t joint_count = 0;
  float cost = 0;  ///< +inf where there is no plan
};

/// Finds a topology for treelets. For one thread: keeps its working memory.
class TreeletSearch {
 public:
  virtual ~TreeletSearch() = default;

  /// The plan for these leaves, 2 to the largest size of the search.
  /// @param leaves  with their costs, 0 where they do not count
  virtual TreeletPlan Find(std::span<const Subtree> leaves) = 0;
};

/// The cheapest k-d tree (Bulavintsev and Zhdanov 2020: partitions whose parts overlap cost
/// infinity), by dynamic programming over the subsets that cuts can reach. The leaves of a subset
/// are swept along each axis in the order of (minimum, maximum, index); a cut is possible where the
/// largest maximum before it is less than the minimum after it: an axis-aligned plane lies between
/// the parts. So a subset of m leaves has at most 3 (m - 1) partitions. Where a subset has no such
/// cut of finite cost, one is possible where the two are equal and the parts touch; photons in that
/// plane may lie in both parts' boxes. On a floor that is an axis-aligned plane most would, of all
/// that touches it: costs, which are sums over nodes, do not see that searches for the nearest then
/// cannot tell which part to visit first, and visit up to a quarter more nodes. Of equal costs the
/// first wins: lower axis, then lower cut. A subset that no cut separates can still be a leaf;
/// below it the plan is a chain. Size at most 16.
std::unique_ptr<TreeletSearch> MakeKdTreeletSearch(const TreeletCost& cost);

/// The cheapest BVH, by dynamic programming over all partitions of all subsets (Karras and Aila
/// 2013, algorithm 2). Of equal costs the first in their order wins. Size at most 9: 3^n
/// partitions.
std::unique_ptr<TreeletSearch> MakeBvhTreeletSearch(const TreeletCost& cost);

/// A BVH by agglomeration: the pair whose joint box has the smallest measure is joined until one is
/// left (Domingues and Pedrini 2015, section 3.2). Of equal measures the first pair wins. A joint
/// of at most B photons becomes a leaf where that is cheaper.
std::unique_ptr<TreeletSearch> MakeAgglomerativeTreeletSearch(const TreeletCost& cost);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_TREELET_SEARCH_H_
