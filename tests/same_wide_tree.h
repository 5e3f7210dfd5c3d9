#ifndef TREELIGHT_TESTS_SAME_WIDE_TREE_H_
#define TREELIGHT_TESTS_SAME_WIDE_TREE_H_

#include <cstdint>
#include <cstring>
#include <vector>

#include "gtest/gtest.h"
#include "tests/wide_reference.h"

namespace treelight {

/// Whether a wide tree in `boxes` has the bits of the reference, wherever its levels lie.
inline testing::AssertionResult SameWideTree(const std::vector<WideBox>& boxes,
                                             const WideTree& shape, const WideSizes& sizes,
                                             const reference::WideReference& expected) {
  if (sizes.level_count != expected.sizes.level_count) {
    return testing::AssertionFailure()
           << sizes.level_count << " levels, expected " << expected.sizes.level_count;
  }
  for (std::uint32_t level = 0; level < sizes.level_count; ++level) {
    const std::uint32_t count = expected.sizes.counts[level];
    if (sizes.counts[level] != count) {
      return testing::AssertionFailure()
             << "level " << level << " has " << sizes.counts[level] << " boxes, expected " << count;
    }
    for (std::uint32_t i = 0; i <= count; ++i) {
      const WideBox& box = boxes[shape.offsets[level] + i];
      const WideBox& same = expected.boxes[expected.shape.offsets[level] + i];
      // Of the box that ends a level `first` alone.
      if (i < count ? std::memcmp(&box, &same, sizeof box) != 0 : box.first != same.first)
        return testing::AssertionFailure() << "box " << i << " of level " << level << " differs";
    }
  }
  return testing::AssertionSuccess();
}

}  // namespace treelight

#endif  // TREELIGHT_TESTS_SAME_WIDE_TREE_H_
