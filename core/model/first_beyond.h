#ifndef TREELIGHT_CORE_MODEL_FIRST_BEYOND_H_
#define TREELIGHT_CORE_MODEL_FIRST_BEYOND_H_

#include <cstddef>
#include <span>

namespace treelight {

/// The index of the first of `numbers` that is NaN or whose magnitude is above `limit`; their count
/// where there is none. As fast as the memory where all are fine.
std::size_t FirstBeyond(std::span<const float> numbers, float limit);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_FIRST_BEYOND_H_
