#include "core/gpu/placed_photons.h"

#include <span>
#include <utility>
#include <vector>

namespace treelight {

PlacedPhotons PlaceTree(const Gpu& gpu, const Tree& tree) {
  // A walk in leaf order. Levels are depths: of a subtree's two boundaries, the one with the larger
  // depth is its parent's.
  struct Visit {
    std::uint32_t link, first, count, depth;
  };
  const auto n = static_cast<std::uint32_t>(tree.photons.size());
  std::vector<cl_uchar> levels(n - 1, 0);
  std::vector<cl_uint> firsts;
  std::vector<Visit> stack{{tree.root.link, 0, n, 0}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    if ((visit.link & kLeafBit) != 0) {
      firsts.push_back(visit.first);
      continue;
    }
    const Node& node = tree.nodes[visit.link];
    const std::uint32_t middle = visit.first + node.left_count;
    levels[middle - 1] = static_cast<cl_uchar>(visit.depth);
    stack.push_back({node.right, middle, node.right_count, visit.depth + 1});
    stack.push_back({node.left, visit.first, node.left_count, visit.depth + 1});
  }
  const std::size_t leaf_count = firsts.size();
  firsts.push_back(n);
  const auto upload = [&gpu]<typename T>(const std::vector<T>& values) {
    return MakeBuffer(gpu.memory(), gpu.queue(), std::span<const T>(values));
  };
  return {upload(tree.photons), {leaf_count, upload(firsts)}, upload(levels)};
}

}  // namespace treelight
