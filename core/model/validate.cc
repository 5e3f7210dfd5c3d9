#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/model/tree.h"
#include "fmt/format.h"

namespace treelight {
namespace {

/// What the links above say of a subtree, to be proved.
struct Claim {
  std::uint32_t link;
  std::uint32_t count;
  std::uint32_t min_id;
  Box box;
  std::uint32_t depth;
};

/// What a subtree is; known when both children are.
struct Fact {
  std::uint32_t count = 0;
  std::uint32_t min_id = kNoPhoton;
  Box box;
};

class Validator {
 public:
  Validator(const Tree& tree, const Photons& photons)
      : tree_(tree), photons_(photons), seen_(photons.size()) {}

  absl::Status Run() {
    const std::size_t n = photons_.size();
    if (tree_.photons.size() != n || tree_.root.count != n) {
      return Broken(1, fmt::format("the tree holds {} photons and counts {}, there are {}",
                                   tree_.photons.size(), tree_.root.count, n));
    }
    if (n == 0) return absl::OkStatus();
    Fact fact;
    const Claim root{tree_.root.link, tree_.root.count, 0, MakeBox(tree_.root.min, tree_.root.max),
                     0};
    if (auto status = Visit(root, fact); !status.ok()) return status;
    if (visited_nodes_ != tree_.nodes.size()) {
      return Broken(1,
                    fmt::format("{} of {} nodes are reached", visited_nodes_, tree_.nodes.size()));
    }
    const auto missing = std::find(seen_.begin(), seen_.end(), false);
    if (missing != seen_.end())
      return Broken(1, fmt::format("photon {} is in no leaf", missing - seen_.begin()));
    return absl::OkStatus();
  }

 private:
  static absl::Status Broken(int invariant, const std::string& what) {
    return absl::InternalError(fmt::format("invariant {}: {}", invariant, what));
  }

  // Recursion is as deep as the tree, and that is checked first.
  absl::Status Visit(const Claim& claim, Fact& fact) {
    if (claim.depth > kMaxDepth)
      return Broken(5, fmt::format("link {:#x} lies deeper than {}", claim.link, kMaxDepth));
    const absl::Status status =
        (claim.link & kLeafBit) != 0 ? VisitLeaf(claim, fact) : VisitNode(claim, fact);
    if (!status.ok()) return status;
    if (fact.count != claim.count) {
      return Broken(1, fmt::format("link {:#x} claims {} photons and has {}", claim.link,
                                   claim.count, fact.count));
    }
    if (fact.min_id != claim.min_id) {
      return Broken(1, fmt::format("link {:#x} claims smallest photon {} and has {}", claim.link,
                                   claim.min_id, fact.min_id));
    }
    if (fact.box != claim.box)
      return Broken(2, fmt::format("the box of link {:#x} is not tight", claim.link));
    return absl::OkStatus();
  }

  absl::Status VisitLeaf(const Claim& claim, Fact& fact) {
    const std::size_t first = claim.link & ~kLeafBit;
    if (claim.count == 0 || first + claim.count > tree_.photons.size()) {
      return Broken(1,
                    fmt::format("leaf {} of {} photons is empty or outside", first, claim.count));
    }
    for (std::size_t i = first; i < first + claim.count; ++i) {
      const LeafPhoton& photon = tree_.photons[i];
      if (photon.id >= photons_.size())
        return Broken(1, fmt::format("photon {} does not exist", photon.id));
      if (seen_[photon.id]) return Broken(1, fmt::format("photon {} is in two leaves", photon.id));
      seen_[photon.id] = true;
      const Vec3 position{photon.x, photon.y, photon.z};
      if (position != photons_.position(photon.id)) {
        return Broken(1, fmt::format("photon {} has moved", photon.id));
      }
      fact.box.Extend(position);
      fact.min_id = std::min(fact.min_id, photon.id);
      ++fact.count;
    }
    if (fact.count > tree_.max_leaf_size && fact.box.min != fact.box.max) {
      return Broken(4, fmt::format("leaf {} holds {} photons, at most {} are allowed", first,
                                   fact.count, tree_.max_leaf_size));
    }
    return absl::OkStatus();
  }

  absl::Status VisitNode(const Claim& claim, Fact& fact) {
    if (claim.link >= tree_.nodes.size())
      return Broken(1, fmt::format("node {} does not exist", claim.link));
    if (++visited_nodes_ > tree_.nodes.size()) return Broken(1, "a node is reached twice");
    const Node& node = tree_.nodes[claim.link];
    Fact left, right;
    if (auto status = Visit({node.left, node.left_count, tree_.min_ids[2 * claim.link],
                             MakeBox(node.left_min, node.left_max), claim.depth + 1},
                            left);
        !status.ok()) {
      return status;
    }
    if (auto status = Visit({node.right, node.right_count, tree_.min_ids[2 * claim.link + 1],
                             MakeBox(node.right_min, node.right_max), claim.depth + 1},
                            right);
        !status.ok()) {
      return status;
    }
    if (tree_.kind == TreeKind::kKdTree && !Separable(left.box, right.box)) {
      return Broken(3, fmt::format("the children of node {} overlap", claim.link));
    }
    fact.count = left.count + right.count;
    fact.min_id = std::min(left.min_id, right.min_id);
    fact.box = left.box;
    fact.box.Extend(right.box);
    return absl::OkStatus();
  }

  const Tree& tree_;
  const Photons& photons_;
  std::vector<bool> seen_;
  std::size_t visited_nodes_ = 0;
};

}  // namespace

absl::Status ValidateTree(const Tree& tree, const Photons& photons) {
  return Validator(tree, photons).Run();
}

}  // namespace treelight
