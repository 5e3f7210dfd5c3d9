#include "core/cpu/simd/packed_tree.h"

#include "tbb/parallel_for.h"

namespace treelight {
namespace {

bool IsBlock(const TreeChild& child) {
  return child.count <= kPackedBlockSize || (child.link & kLeafBit) != 0;
}

std::uint32_t FirstPhoton(const Tree& tree, std::uint32_t link) {
  while ((link & kLeafBit) == 0) link = tree.nodes[link].left;
  return link & ~kLeafBit;
}

template <std::uint32_t W>
class Packer {
 public:
  Packer(const Tree& tree, std::vector<PackedNode<W>>& nodes, std::vector<std::uint32_t>& slots)
      : tree_(tree), nodes_(nodes), slots_(slots) {}

  /// The link of what replaces `subtree`.
  std::uint32_t Pack(const TreeChild& subtree) {
    if (IsBlock(subtree)) return kLeafBit | FirstPhoton(tree_, subtree.link);
    TreeChild children[W] = {subtree};
    std::uint32_t slots[W] = {};
    std::uint32_t child_count = 1;
    while (child_count < W) {
      TreeChild* widest = nullptr;
      for (TreeChild* child = children; child < children + child_count; ++child) {
        if (!IsBlock(*child) && (widest == nullptr || IsWider(*child, *widest))) widest = child;
      }
      if (widest == nullptr) break;
      const std::uint32_t link = widest->link;
      const auto [left, right] = ChildrenOf(tree_, link);
      *widest = left;
      slots[widest - children] = 2 * link;
      slots[child_count] = 2 * link + 1;
      children[child_count++] = right;
    }
    const auto index = static_cast<std::uint32_t>(nodes_.size());
    nodes_.emplace_back();
    slots_.insert(slots_.end(), slots, slots + W);
    std::uint32_t links[W];
    for (std::uint32_t i = 0; i < child_count; ++i) links[i] = Pack(children[i]);
    Store(children, links, child_count, nodes_[index]);
    return index;
  }

 private:
  /// On a line all surfaces are 0.
  static bool IsWider(const TreeChild& a, const TreeChild& b) {
    const double of_a = SurfaceArea(a.box), of_b = SurfaceArea(b.box);
    return of_a > of_b || (of_a == of_b && a.count > b.count);
  }

  static void Store(const TreeChild* children, const std::uint32_t* links,
                    std::uint32_t child_count, PackedNode<W>& node) {
    for (std::uint32_t i = 0; i < W; ++i) {
      const bool used = i < child_count;
      const Box box = used ? children[i].box : Box{};
      for (int axis = 0; axis < 3; ++axis) {
        node.min[axis][i] = Component(box.min, axis);
        node.max[axis][i] = Component(box.max, axis);
      }
      node.links[i] = used ? links[i] : 0;
      node.counts[i] = used ? children[i].count : 0;
      node.min_ids[i] = used ? children[i].min_id : kNoPhoton;
    }
  }

  const Tree& tree_;
  std::vector<PackedNode<W>>& nodes_;
  std::vector<std::uint32_t>& slots_;
};

}  // namespace

template <std::uint32_t W>
PackedTree<W>::PackedTree(const Tree& tree) : count_(tree.root.count) {
  const std::size_t padded = tree.photons.size() + W;
  x_.resize(padded);
  y_.resize(padded);
  z_.resize(padded);
  ids_.resize(padded);
  tbb::parallel_for(std::size_t{0}, padded, [&](std::size_t i) {
    const LeafPhoton photon = i < tree.photons.size() ? tree.photons[i] : LeafPhoton{};
    x_[i] = photon.x;
    y_[i] = photon.y;
    z_[i] = photon.z;
    ids_[i] = photon.id;
  });
  if (count_ == 0) return;
  root_ = Packer<W>(tree, nodes_, slots_)
              .Pack({.box = {}, .link = tree.root.link, .count = count_, .min_id = 0});
}

template class PackedTree<8>;
template class PackedTree<16>;

}  // namespace treelight
