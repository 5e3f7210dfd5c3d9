#include "core/model/heuristic.h"

#include <algorithm>
#include <cmath>

namespace treelight {

Measure::Measure(Heuristic heuristic, const Box& root, float radius)
    : volume_(heuristic == Heuristic::kVvh) {
  const float longest =
      std::max({root.max.x - root.min.x, root.max.y - root.min.y, root.max.z - root.min.z});
  prescale_ = longest < 0x1p-60f ? 0x1p96f : 1.0f;  // the reciprocal of a denormal is infinite
  int exponent = 0;
  std::frexp(longest * prescale_, &exponent);  // longest = mantissa in [0.5, 1) * 2^exponent
  scale_ = std::ldexp(1.0f, -exponent);
  if (heuristic != Heuristic::kSah) {
    grow_ = 2 * std::clamp((radius * prescale_) * scale_, 0x1p-20f, 0x1p20f);
  }
}

}  // namespace treelight
