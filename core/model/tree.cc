#include "core/model/tree.h"

namespace treelight {

std::array<TreeChild, 2> ChildrenOf(const Tree& tree, std::uint32_t link) {
  const Node& node = tree.nodes[link];
  const std::uint32_t* const min_ids = &tree.min_ids[2 * std::size_t{link}];
  return {{{MakeBox(node.left_min, node.left_max), node.left, node.left_count, min_ids[0]},
           {MakeBox(node.right_min, node.right_max), node.right, node.right_count, min_ids[1]}}};
}

std::vector<float> PositionsById(const std::vector<LeafPhoton>& photons) {
  std::vector<float> positions(3 * photons.size());
  for (const LeafPhoton& photon : photons) {
    float* const p = &positions[3 * std::size_t{photon.id}];
    p[0] = photon.x, p[1] = photon.y, p[2] = photon.z;
  }
  return positions;
}

}  // namespace treelight
