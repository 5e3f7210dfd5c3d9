#ifndef TREELIGHT_TESTS_WIDE_REFERENCE_H_
#define TREELIGHT_TESTS_WIDE_REFERENCE_H_

#include <cstdint>
#include <vector>

#include "core/kernels/types.h"
#include "core/model/tree.h"

namespace treelight::reference {

/// The wide tree as wide_tree.cl lays it out: `boxes` of all levels, each with the one that ends
/// it.
struct WideReference {
  std::vector<WideBox> boxes;
  WideTree shape{};
  WideSizes sizes{};
};

/// The wide tree of a tree of at least one photon, by recursion. Aborts where it has more than
/// kMaxWideLevels.
/// @param levels  [n - 1] split levels, or others by which the tree can be told: where a subtree is
///                divided, the level is below all levels within it
WideReference MakeWideTree(const Tree& tree, const std::vector<std::uint8_t>& levels);

}  // namespace treelight::reference

#endif  // TREELIGHT_TESTS_WIDE_REFERENCE_H_
