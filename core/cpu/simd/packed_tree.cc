#include "core/cpu/simd/packed_tree.h"

#include <limits>

#include "tbb/parallel_for.h"

namespace treelight {
namespace {

/// A subtree of the binary tree that becomes a child.
struct Part {
  float min[3], max[3];
  std::uint32_t link, count, min_id;

  bool is_block() const { return count <= kPackedBlockSize || (link & kLeafBit) != 0; }

  /// Half the surface of the box; what is chosen by it may be anything, so overflow does no harm.
  float Surface() const {
    const float dx = max[0] - min[0], dy = max[1] - min[1], dz = max[2] - min[2];
    return dx * dy + dy * dz + dz * dx;
  }
};

Part LeftPart(const Tree& tree, std::uint32_t link) {
  const Node& n = tree.nodes[link];
  return {{n.left_min[0], n.left_min[1], n.left_min[2]},
          {n.left_max[0], n.left_max[1], n.left_max[2]},
          n.left,
          n.left_count,
          tree.min_ids[2 * std::size_t{link}]};
}

Part RightPart(const Tree& tree, std::uint32_t link) {
  const Node& n = tree.nodes[link];
  return {{n.right_min[0], n.right_min[1], n.right_min[2]},
          {n.right_max[0], n.right_max[1], n.right_max[2]},
          n.right,
          n.right_count,
          tree.min_ids[2 * std::size_t{link} + 1]};
}

std::uint32_t FirstPhoton(const Tree& tree, std::uint32_t link) {
  while ((link & kLeafBit) == 0) link = tree.nodes[link].left;
  return link & ~kLeafBit;
}

template <std::uint32_t W>
class Packer {
 public:
  Packer(const Tree& tree, std::vector<PackedNode<W>>& nodes) : tree_(tree), nodes_(nodes) {}

  /// The link of what replaces `part`.
  std::uint32_t Pack(const Part& part) {
    if (part.is_block()) return kLeafBit | FirstPhoton(tree_, part.link);
    Part parts[W] = {LeftPart(tree_, part.link), RightPart(tree_, part.link)};
    std::uint32_t part_count = 2;
    while (part_count < W) {
      std::uint32_t widest = W;
      for (std::uint32_t i = 0; i < part_count; ++i) {
        if (parts[i].is_block()) continue;
        if (widest == W || IsWider(parts[i], parts[widest])) widest = i;
      }
      if (widest == W) break;
      const std::uint32_t link = parts[widest].link;
      parts[widest] = LeftPart(tree_, link);
      parts[part_count++] = RightPart(tree_, link);
    }
    const auto index = static_cast<std::uint32_t>(nodes_.size());
    nodes_.emplace_back();
    std::uint32_t links[W];
    for (std::uint32_t i = 0; i < part_count; ++i) links[i] = Pack(parts[i]);
    Store(parts, links, part_count, nodes_[index]);
    return index;
  }

 private:
  /// On a line all surfaces are 0.
  static bool IsWider(const Part& a, const Part& b) {
    const float of_a = a.Surface(), of_b = b.Surface();
    return of_a > of_b || (of_a == of_b && a.count > b.count);
  }

  static void Store(const Part* parts, const std::uint32_t* links, std::uint32_t part_count,
                    PackedNode<W>& node) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    for (std::uint32_t i = 0; i < W; ++i) {
      const bool used = i < part_count;
      for (int axis = 0; axis < 3; ++axis) {
        node.min[axis][i] = used ? parts[i].min[axis] : kInfinity;
        node.max[axis][i] = used ? parts[i].max[axis] : -kInfinity;
      }
      node.links[i] = used ? links[i] : 0;
      node.counts[i] = used ? parts[i].count : 0;
      node.min_ids[i] = used ? parts[i].min_id : kNoPhoton;
    }
  }

  const Tree& tree_;
  std::vector<PackedNode<W>>& nodes_;
};

}  // namespace

template <std::uint32_t W>
PackedTree<W>::PackedTree(const Tree& tree) : count_(tree.root.count) {
  const std::size_t padded = tree.photons.size() + W;
  x_.resize(padded);
  y_.resize(padded);
  z_.resize(padded);
  ids_.resize(padded);
  tbb::parallel_for(std::size_t{0}, tree.photons.size(), [&](std::size_t i) {
    const LeafPhoton& photon = tree.photons[i];
    x_[i] = photon.x;
    y_[i] = photon.y;
    z_[i] = photon.z;
    ids_[i] = photon.id;
  });
  if (count_ == 0) return;
  root_ = Packer<W>(tree, nodes_)
              .Pack({.min = {}, .max = {}, .link = tree.root.link, .count = count_, .min_id = 0});
}

template class PackedTree<8>;
template class PackedTree<16>;

}  // namespace treelight
