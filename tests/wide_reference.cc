#include "tests/wide_reference.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <utility>

namespace treelight::reference {
namespace {

using Places = std::vector<std::uint32_t>;

/// Appends the first photons of the blocks below a child of `tree`: of the largest subtrees of at
/// most kBlockSize photons, and of leaves of more.
void ListBlocks(const Tree& tree, std::uint32_t link, std::uint32_t count, Places& firsts) {
  if (count > kBlockSize && (link & kLeafBit) == 0) {
    const Node& node = tree.nodes[link];
    ListBlocks(tree, node.left, node.left_count, firsts);
    ListBlocks(tree, node.right, node.right_count, firsts);
    return;
  }
  while ((link & kLeafBit) == 0) link = tree.nodes[link].left;
  firsts.push_back(link & ~kLeafBit);
}

/// Appends the first members of the largest subtrees of at most 32 of the members [begin, end):
/// recursion over the smallest level of a range, the last of several. `meets` [i]: level between
/// members i and i + 1.
void ListNodes(const std::vector<std::uint8_t>& meets, std::uint32_t begin, std::uint32_t end,
               Places& nodes) {
  if (end - begin <= 32) return nodes.push_back(begin);
  std::uint32_t lowest = begin;
  for (std::uint32_t i = begin; i + 1 < end; ++i)
    if (meets[i] <= meets[lowest]) lowest = i;
  ListNodes(meets, begin, lowest + 1, nodes);
  ListNodes(meets, lowest + 1, end, nodes);
}

/// Where more than 4 nodes begin among 32 neighbours, these become one node.
Places WithoutSmallNodes(const Places& nodes, std::size_t member_count) {
  Places kept;
  bool many_before = false;
  auto next = nodes.begin();
  for (std::uint32_t begin = 0; begin < member_count; begin += 32) {
    const auto end = std::lower_bound(next, nodes.end(), begin + 32);
    const bool many = end - next > 4;
    if (many || many_before) kept.push_back(begin);
    if (!many)
      std::copy(next + (many_before && next != end && *next == begin), end,
                std::back_inserter(kept));
    many_before = many;
    next = end;
  }
  return kept;
}

/// The box of photons [first, last) of a tree, but for WideBox::first.
WideBox BoxOf(const std::vector<LeafPhoton>& photons, std::uint32_t first, std::uint32_t last) {
  WideBox box{{INFINITY, INFINITY, INFINITY}, kNoPhoton, {-INFINITY, -INFINITY, -INFINITY}, 0};
  for (std::uint32_t i = first; i < last; ++i) {
    const float p[3] = {photons[i].x, photons[i].y, photons[i].z};
    for (int c = 0; c < 3; ++c) {
      box.min[c] = std::min(box.min[c], p[c]);
      box.max[c] = std::max(box.max[c], p[c]);
    }
    box.min_id = std::min(box.min_id, photons[i].id);
  }
  return box;
}

}  // namespace

WideReference MakeWideTree(const Tree& tree, const std::vector<std::uint8_t>& levels) {
  WideReference wide;
  Places begins;  // first photon of each box of a level
  ListBlocks(tree, tree.root.link, tree.root.count, begins);
  Places members = begins;  // of each box: its first member below
  std::uint32_t member_count = tree.root.count;
  for (std::uint32_t level = 0; level < kMaxWideLevels; ++level) {
    const auto count = static_cast<std::uint32_t>(begins.size());
    wide.shape.offsets[level] = static_cast<std::uint32_t>(wide.boxes.size());
    wide.sizes.counts[level] = count;
    wide.sizes.level_count = level + 1;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t end = i + 1 < count ? begins[i + 1] : tree.root.count;
      wide.boxes.push_back(BoxOf(tree.photons, begins[i], end));
      wide.boxes.back().first = members[i];
    }
    wide.boxes.emplace_back().first = member_count;
    if (count <= 32) return wide;
    std::vector<std::uint8_t> meets;
    for (std::uint32_t i = 1; i < count; ++i) meets.push_back(levels[begins[i] - 1]);
    Places nodes;
    ListNodes(meets, 0, count, nodes);
    members = WithoutSmallNodes(nodes, count);
    member_count = count;
    Places above;
    for (const std::uint32_t member : members) above.push_back(begins[member]);
    begins = std::move(above);
  }
  std::abort();
}

}  // namespace treelight::reference
