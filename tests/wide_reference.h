#ifndef TREELIGHT_TESTS_WIDE_REFERENCE_H_
#define TREELIGHT_TESTS_WIDE_REFERENCE_H_

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

/// The wide tree of a tree of at least one photon, by recursion over the tree. Aborts where it has
/// more than kMaxWideLevels.
WideReference MakeWideTree(const Tree& tree);

}  // namespace treelight::reference

#endif  // TREELIGHT_TESTS_WIDE_REFERENCE_H_
