#ifndef TREELIGHT_CORE_MODEL_FINITE_FLOAT_H_
#define TREELIGHT_CORE_MODEL_FINITE_FLOAT_H_

#include <algorithm>
#include <limits>

namespace treelight {

/// The nearest float that is finite.
inline float FiniteFloat(double value) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  return static_cast<float>(std::clamp(value, -kLargest, kLargest));
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_FINITE_FLOAT_H_
