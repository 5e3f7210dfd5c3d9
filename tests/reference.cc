#include "tests/reference.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace treelight::reference {
namespace {

Vec3 PositionOf(const std::vector<float>& positions, std::uint32_t id) {
  return {positions[3 * id] + 0.0f, positions[3 * id + 1] + 0.0f, positions[3 * id + 2] + 0.0f};
}

std::uint64_t Interleave(const std::uint64_t cells[3], int bits_per_axis) {
  std::uint64_t code = 0;
  for (int bit = bits_per_axis - 1; bit >= 0; --bit) {
    for (int axis = 0; axis < 3; ++axis) code = code << 1 | (cells[axis] >> bit & 1);
  }
  return code;
}

std::uint64_t CodeOf(const Vec3& p, const MortonGrid& grid, int bits_per_axis) {
  const float last = std::exp2(static_cast<float>(bits_per_axis)) - 1;
  std::uint64_t cells[3];
  for (int axis = 0; axis < 3; ++axis) {
    const float cell = (Component(p, axis) - grid.min[axis]) * grid.prescale * grid.scale[axis];
    cells[axis] = cell >= last ? static_cast<std::uint64_t>(last)
                               : static_cast<std::uint64_t>(std::max(cell, 0.0f));
  }
  return Interleave(cells, bits_per_axis);
}

Box BoxOf(const std::vector<float>& positions, const std::vector<std::uint32_t>& ids,
          std::size_t first, std::size_t last) {
  Box box;
  for (std::size_t i = first; i < last; ++i) box.Extend(PositionOf(positions, ids[i]));
  return box;
}

/// Cube over `box` whose scale is a power of two that uses half to all of 1024 cells.
MortonGrid PowerOfTwoGrid(const Box& box) {
  const float longest =
      std::max({box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  MortonGrid grid{};
  grid.prescale = longest < 0x1p-60f ? 0x1p96f : 1.0f;
  int exponent = 0;
  std::frexp(longest * grid.prescale, &exponent);  // longest = mantissa in [0.5, 1) * 2^exponent
  for (int axis = 0; axis < 3; ++axis) {
    grid.min[axis] = Component(box.min, axis);
    grid.scale[axis] = std::ldexp(1.0f, 10 - exponent);
  }
  return grid;
}

class TieBreaker {
 public:
  TieBreaker(const std::vector<float>& positions, std::uint32_t max_leaf_size,
             std::vector<std::uint32_t>& ids, std::vector<std::uint8_t>& levels)
      : positions_(positions), max_leaf_size_(max_leaf_size), ids_(ids), levels_(levels) {}

  /// Rebuilds the runs of ties within [first, last); `level` is the next one free.
  void Break(std::size_t first, std::size_t last, int level) {
    for (std::size_t begin = first; begin < last;) {
      std::size_t end = begin + 1;
      while (end < last && levels_[end - 1] == kLevelTied) ++end;
      if (end - begin > max_leaf_size_) BreakRun(begin, end, level);
      begin = end;
    }
  }

 private:
  void BreakRun(std::size_t first, std::size_t last, int level) {
    const Box box = BoxOf(positions_, ids_, first, last);
    if (box.min == box.max) {
      std::fill(levels_.begin() + first, levels_.begin() + last - 1, kLevelSame);
    } else if (level + 30 <= 93) {
      SplitByCodes(first, last, level, PowerOfTwoGrid(box));
      Break(first, last, level + 30);
    } else {
      SplitAtMedian(first, last, level, box);
      Break(first, last, level + 1);
    }
  }

  void SplitByCodes(std::size_t first, std::size_t last, int level, const MortonGrid& grid) {
    const auto code = [&](std::uint32_t id) {
      return CodeOf(PositionOf(positions_, id), grid, 10);
    };
    std::stable_sort(ids_.begin() + first, ids_.begin() + last,
                     [&](std::uint32_t a, std::uint32_t b) { return code(a) < code(b); });
    for (std::size_t i = first; i + 1 < last; ++i) {
      for (int bit = 0; bit < 30 && levels_[i] == kLevelTied; ++bit) {
        if ((code(ids_[i]) >> (29 - bit) & 1) != (code(ids_[i + 1]) >> (29 - bit) & 1)) {
          levels_[i] = static_cast<std::uint8_t>(level + bit);
        }
      }
    }
  }

  void SplitAtMedian(std::size_t first, std::size_t last, int level, const Box& box) {
    int widest = 0;
    for (int axis = 1; axis < 3; ++axis) {
      const auto extent = [&](int a) { return Component(box.max, a) - Component(box.min, a); };
      if (extent(axis) > extent(widest)) widest = axis;
    }
    std::stable_sort(ids_.begin() + first, ids_.begin() + last,
                     [&](std::uint32_t a, std::uint32_t b) {
                       return Component(PositionOf(positions_, a), widest) <
                              Component(PositionOf(positions_, b), widest);
                     });
    const std::size_t leaf_count = (last - first + max_leaf_size_ - 1) / max_leaf_size_;
    levels_[first + (leaf_count + 1) / 2 * max_leaf_size_ - 1] = static_cast<std::uint8_t>(level);
  }

  const std::vector<float>& positions_;
  const std::size_t max_leaf_size_;
  std::vector<std::uint32_t>& ids_;
  std::vector<std::uint8_t>& levels_;
};

/// Boundary with the smallest level among those between photons first and last - 1; it lies after
/// photon first + k.
std::size_t SmallestLevel(const std::vector<std::uint8_t>& levels, std::size_t first,
                          std::size_t last) {
  return std::min_element(levels.begin() + first, levels.begin() + last - 1) - levels.begin();
}

void ListLeaves(const std::vector<std::uint8_t>& levels, std::size_t first, std::size_t last,
                std::uint32_t max_leaf_size, std::vector<std::uint32_t>& firsts) {
  if (last - first <= max_leaf_size) {
    firsts.push_back(static_cast<std::uint32_t>(first));
    return;
  }
  const std::size_t split = SmallestLevel(levels, first, last);
  ListLeaves(levels, first, split + 1, max_leaf_size, firsts);
  ListLeaves(levels, split + 1, last, max_leaf_size, firsts);
}

struct Subtree {
  std::uint32_t link, count, min_id, depth;
  Box box;
};

Subtree MakeSubtree(const std::vector<std::uint8_t>& levels,
                    const std::vector<std::uint32_t>& firsts, std::size_t first, std::size_t last,
                    Tree& tree) {
  if (last - first == 1) {
    Subtree leaf{kLeafBit | firsts[first], firsts[last] - firsts[first], kNoPhoton, 0, {}};
    for (std::uint32_t i = firsts[first]; i < firsts[last]; ++i) {
      leaf.box.Extend(Vec3{tree.photons[i].x, tree.photons[i].y, tree.photons[i].z});
      leaf.min_id = std::min(leaf.min_id, tree.photons[i].id);
    }
    return leaf;
  }
  std::size_t split = first;
  for (std::size_t i = first; i + 1 < last; ++i) {
    if (levels[firsts[i + 1] - 1] < levels[firsts[split + 1] - 1]) split = i;
  }
  const Subtree left = MakeSubtree(levels, firsts, first, split + 1, tree);
  const Subtree right = MakeSubtree(levels, firsts, split + 1, last, tree);
  Node& node = tree.nodes[split];
  const auto store = [](const Vec3& v, float* to) { to[0] = v.x, to[1] = v.y, to[2] = v.z; };
  store(left.box.min, node.left_min);
  store(left.box.max, node.left_max);
  store(right.box.min, node.right_min);
  store(right.box.max, node.right_max);
  node.left = left.link;
  node.right = right.link;
  node.left_count = left.count;
  node.right_count = right.count;
  tree.min_ids[2 * split] = left.min_id;
  tree.min_ids[2 * split + 1] = right.min_id;
  Subtree both{static_cast<std::uint32_t>(split), left.count + right.count,
               std::min(left.min_id, right.min_id), std::max(left.depth, right.depth) + 1,
               left.box};
  both.box.Extend(right.box);
  return both;
}

}  // namespace

Box Bounds(const std::vector<float>& positions) {
  Box box;
  for (std::uint32_t i = 0; i < positions.size() / 3; ++i) box.Extend(PositionOf(positions, i));
  return box;
}

std::vector<std::uint64_t> MortonCodes(const std::vector<float>& positions, const MortonGrid& grid,
                                       int bits_per_axis) {
  std::vector<std::uint64_t> codes;
  for (std::uint32_t i = 0; i < positions.size() / 3; ++i) {
    codes.push_back(CodeOf(PositionOf(positions, i), grid, bits_per_axis));
  }
  return codes;
}

std::vector<std::uint32_t> SortedIds(const std::vector<std::uint64_t>& codes) {
  std::vector<std::uint32_t> ids(codes.size());
  std::iota(ids.begin(), ids.end(), 0u);
  std::stable_sort(ids.begin(), ids.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return codes[a] < codes[b]; });
  return ids;
}

std::vector<std::uint8_t> SplitLevels(const std::vector<std::uint64_t>& sorted_codes,
                                      int code_bits) {
  std::vector<std::uint8_t> levels;
  for (std::size_t i = 0; i + 1 < sorted_codes.size(); ++i) {
    int level = 0;
    while (level < code_bits && (sorted_codes[i] >> (code_bits - 1 - level) & 1) ==
                                    (sorted_codes[i + 1] >> (code_bits - 1 - level) & 1)) {
      ++level;
    }
    levels.push_back(
        static_cast<std::uint8_t>(level == code_bits ? static_cast<int>(kLevelTied) : level));
  }
  return levels;
}

void BreakTies(const std::vector<float>& positions, int code_bits, std::uint32_t max_leaf_size,
               std::vector<std::uint32_t>& ids, std::vector<std::uint8_t>& levels) {
  TieBreaker(positions, max_leaf_size, ids, levels).Break(0, ids.size(), code_bits);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (levels[i] < kLevelSame) continue;
    int leading_zeros = 0;
    while ((i ^ (i + 1)) >> (31 - leading_zeros) == 0) ++leading_zeros;
    levels[i] = static_cast<std::uint8_t>(kLevelIndex + leading_zeros);
  }
}

std::vector<std::uint32_t> LeafFirsts(const std::vector<std::uint8_t>& levels, std::size_t count,
                                      std::uint32_t max_leaf_size) {
  std::vector<std::uint32_t> firsts;
  if (count > 0) ListLeaves(levels, 0, count, max_leaf_size, firsts);
  firsts.push_back(static_cast<std::uint32_t>(count));
  return firsts;
}

Tree Hierarchy(const std::vector<std::uint8_t>& levels,
               const std::vector<std::uint32_t>& leaf_firsts,
               const std::vector<LeafPhoton>& photons, std::uint32_t max_leaf_size) {
  const std::size_t leaf_count = leaf_firsts.size() - 1;
  Tree tree;
  tree.max_leaf_size = max_leaf_size;
  tree.photons = photons;
  tree.nodes.resize(leaf_count - 1);
  tree.min_ids.resize(2 * (leaf_count - 1));
  const Subtree root = MakeSubtree(levels, leaf_firsts, 0, leaf_count, tree);
  tree.root = {{root.box.min.x, root.box.min.y, root.box.min.z},
               {root.box.max.x, root.box.max.y, root.box.max.z},
               root.link,
               root.count,
               root.depth};
  return tree;
}

}  // namespace treelight::reference
