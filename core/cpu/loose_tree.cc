#include "core/cpu/loose_tree.h"

#include <algorithm>

namespace treelight {
namespace {

void Store(const Vec3& v, float* to) { to[0] = v.x, to[1] = v.y, to[2] = v.z; }

class Loosener {
 public:
  explicit Loosener(const Tree& tree) : tree_(tree) { loose_.nodes.resize(tree.nodes.size()); }

  LooseTree Run() {
    loose_.photons.assign(tree_.photons.begin(), tree_.photons.end());
    const Root& root = tree_.root;
    if (root.count > 0) {
      loose_.root = Visit({.box = MakeBox(root.min, root.max),
                           .link = root.link,
                           .count = root.count,
                           .min_id = 0});
    }
    return std::move(loose_);
  }

 private:
  Subtree Visit(const TreeChild& child) {
    if ((child.link & kLeafBit) != 0) {
      return {.box = child.box, .link = child.link, .count = child.count, .min_id = child.min_id};
    }
    const auto [left, right] = ChildrenOf(tree_, child.link);
    const std::array<Subtree, 2> below = {Visit(left), Visit(right)};
    loose_.nodes[child.link] = below;
    return Join(child.link, below[0], below[1]);
  }

  const Tree& tree_;
  LooseTree loose_;
};

class Arranger {
 public:
  explicit Arranger(const LooseTree& loose) : loose_(loose) {
    tree_.photons.reserve(loose.photons.size());
  }

  Tree Run() {
    if (loose_.photons.empty()) return std::move(tree_);
    const Subtree& root = loose_.root;
    Store(root.box.min, tree_.root.min);
    Store(root.box.max, tree_.root.max);
    tree_.root.count = root.count;
    tree_.root.link = Visit(root, 0);
    return std::move(tree_);
  }

 private:
  /// Appends what is below `subtree` and returns its link.
  std::uint32_t Visit(const Subtree& subtree, std::uint32_t depth) {
    if (subtree.is_leaf() || subtree.merged) {
      tree_.root.depth = std::max(tree_.root.depth, depth);
      const auto first = static_cast<std::uint32_t>(tree_.photons.size());
      AppendPhotons(subtree);
      return kLeafBit | first;
    }
    // The leaves so far are those left of this node: it gets the index of the last of them, and
    // nodes are appended in that order.
    const auto& [left, right] = loose_.nodes[subtree.link];
    const std::uint32_t left_link = Visit(left, depth + 1);
    const auto link = static_cast<std::uint32_t>(tree_.nodes.size());
    tree_.nodes.emplace_back();
    tree_.min_ids.insert(tree_.min_ids.end(), {left.min_id, right.min_id});
    const std::uint32_t right_link = Visit(right, depth + 1);
    Node& node = tree_.nodes[link];
    Store(left.box.min, node.left_min);
    Store(left.box.max, node.left_max);
    Store(right.box.min, node.right_min);
    Store(right.box.max, node.right_max);
    node.left = left_link;
    node.right = right_link;
    node.left_count = left.count;
    node.right_count = right.count;
    return link;
  }

  void AppendPhotons(const Subtree& subtree) {
    if (subtree.is_leaf()) {
      const auto first = loose_.photons.begin() + (subtree.link & ~kLeafBit);
      tree_.photons.insert(tree_.photons.end(), first, first + subtree.count);
      return;
    }
    for (const Subtree& child : loose_.nodes[subtree.link]) AppendPhotons(child);
  }

  const LooseTree& loose_;
  Tree tree_;
};

}  // namespace

Subtree MakeLeaf(std::span<const LeafPhoton> photons, std::uint32_t first, std::uint32_t last) {
  Subtree leaf{.box = {}, .link = kLeafBit | first, .count = last - first, .min_id = kNoPhoton};
  for (std::uint32_t i = first; i < last; ++i) {
    leaf.box.Extend(Vec3{photons[i].x, photons[i].y, photons[i].z});
    leaf.min_id = std::min(leaf.min_id, photons[i].id);
  }
  return leaf;
}

Subtree Join(std::uint32_t link, const Subtree& left, const Subtree& right) {
  Subtree both{.box = left.box,
               .link = link,
               .count = left.count + right.count,
               .min_id = std::min(left.min_id, right.min_id),
               .leaf_count = left.leaf_count + right.leaf_count,
               .height = std::max(left.height, right.height) + 1};
  both.box.Extend(right.box);
  return both;
}

LooseTree Loosen(const Tree& tree) { return Loosener(tree).Run(); }

Tree Arrange(const LooseTree& loose, TreeKind kind, std::uint32_t max_leaf_size) {
  Tree tree = Arranger(loose).Run();
  tree.kind = kind;
  tree.max_leaf_size = max_leaf_size;
  return tree;
}

}  // namespace treelight
