#ifndef TREELIGHT_CORE_CPU_SIMD_PACKED_TREE_H_
#define TREELIGHT_CORE_CPU_SIMD_PACKED_TREE_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/cpu/raw_vector.h"
#include "core/model/tree.h"

namespace treelight {

/// Photons of a block, at most, but for a leaf of more.
inline constexpr std::uint32_t kPackedBlockSize = 32;

/// Node of a packed tree: W children as a structure of arrays, so that one vector operation tests
/// all of them. A place without a child has an inverted infinite box, which nothing is near to.
template <std::uint32_t W>
struct alignas(64) PackedNode {
  float min[3][W], max[3][W];  ///< tight boxes, scene units
  std::uint32_t links[W];      ///< index of a node, or kLeafBit | first photon of a block
  std::uint32_t counts[W];     ///< photons below
  std::uint32_t min_ids[W];    ///< smallest photon index below
};

/// What searches read of a packed tree.
template <std::uint32_t W>
struct PackedView {
  const PackedNode<W>* nodes = nullptr;
  /// [n + W] photons in leaf order, and zeros, so that the last vector may be read whole.
  const float *x = nullptr, *y = nullptr, *z = nullptr;
  const std::uint32_t* ids = nullptr;
  const std::uint32_t* slots =
      nullptr;              ///< [W * nodes] which child of the tree each was: 2 * node + side
  std::uint32_t root = 0;   ///< a link
  std::uint32_t count = 0;  ///< photons
};

/// A tree as searches by SIMD read it: nodes of W children, made by replacing the child with the
/// largest surface by its own children until there are W; subtrees of at most kPackedBlockSize
/// photons are blocks, their photons a structure of arrays in leaf order.
template <std::uint32_t W>
class PackedTree {
 public:
  explicit PackedTree(const Tree& tree);

  PackedView<W> view() const {
    return {nodes_.data(), x_.data(),     y_.data(), z_.data(),
            ids_.data(),   slots_.data(), root_,     count_};
  }
  std::size_t bytes() const {
    return nodes_.size() * (sizeof(PackedNode<W>) + W * sizeof(std::uint32_t)) +
           x_.size() * (3 * sizeof(float) + 4);
  }

 private:
  std::vector<PackedNode<W>> nodes_;
  RawVector<float> x_, y_, z_;
  RawVector<std::uint32_t> ids_;
  std::vector<std::uint32_t> slots_;  // which child of the tree each was: 2 * node + side
  std::uint32_t root_ = 0, count_ = 0;
};

extern template class PackedTree<8>;
extern template class PackedTree<16>;

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_PACKED_TREE_H_
